// The selected cells as a mesh of hexahedra with shared corners, for finite elements: cells with a
// common face, edge or corner have common points.
//
// The grid is divided into slabs, which are layers of bricks perpendicular to x. A sweep visits one
// slab after the other. It stores the bricks and the points of two slabs, never the complete mesh.
// Points are grouped like cells: a PointBrick has the points at the low corners of the 4x4x4 cells
// of a brick. So points on the upper sides of a brick belong to its neighbors' PointBricks. The
// points of a slab get consecutive numbers in the order (y, z) of their PointBricks. The points of
// a slab depend only on the bricks of this slab and of the previous slab.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/base/page_buffer.h"
#include "core/dag/brick.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {

// Sizes of the mesh's slabs, found by one visit of all bricks.
struct HexSlabs {
  // Throws Error{kInvalidInput} if no cell is selected.
  explicit HexSlabs(const ExportJob& job);

  uint64_t voxels = 0;
  int64_t first = 0;                   // the first slab with bricks
  std::vector<uint32_t> brick_counts;  // bricks per slab from `first` on; the last is not 0
};

// Visits the mesh slab by slab. After each call of next() that returns true, for_each_point()
// visits the points of a new slab, and for_each_cell() visits the cells of the slab before it. So
// every point of a cell is visited before the cell or in the same step. All sweeps visit points and
// cells in the same order.
class HexSweep {
 public:
  // `job` and `slabs` must outlive this object.
  HexSweep(const ExportJob& job, const HexSlabs& slabs) : job_(job), slabs_(slabs) {}

  // Moves to the next slab. Returns false after the last one. Throws Error{kOutOfMemory} if two
  // slabs do not fit in the job's memory.
  bool next();
  // The number of points visited so far, including the current slab's.
  uint64_t points() const { return next_point_; }
  uint64_t cells() const { return cells_; }

  // Calls visit(position) for each point of the slab, in the order of their numbers, which begin at
  // 0 for the first point of the mesh.
  template <class Visit>
  void for_each_point(const Visit& visit) const;
  // Calls visit(cell, points) for each cell. `points` has the numbers of the points at the low
  // corner plus (0,0,0), (1,0,0), (1,1,0), (0,1,0), (0,0,1), (1,0,1), (1,1,1), (0,1,1): the order
  // of hexahedra in VTK and Abaqus.
  template <class Visit>
  void for_each_cell(const Visit& visit) const;

 private:
  // The selected cells of a brick. `place` is place_of(y, z), where y and z are the position of the
  // brick in its slab, in bricks.
  struct HexBrick {
    uint64_t place = 0;
    uint64_t mask = 0;
  };
  // The points at the low corners of a brick's cells. `place` has the same meaning as in HexBrick.
  struct PointBrick {
    uint64_t place = 0;
    uint64_t mask = 0;
    uint64_t first = 0;  // number of the first point
  };
  template <class T>
  struct Slab {
    PageBuffer<T> items;  // in the order of their places
    uint64_t count = 0;
  };
  using Points = std::array<uint64_t, 8>;

  static uint64_t place_of(int64_t y, int64_t z) {
    return static_cast<uint64_t>(y) << 32 | static_cast<uint64_t>(z);
  }
  static Position corner_of(int64_t slab, uint64_t place) {
    return {slab * kBrickEdge, static_cast<int64_t>(place >> 32) * kBrickEdge,
            static_cast<int64_t>(place & UINT32_MAX) * kBrickEdge};
  }
  Slab<HexBrick> read_slab(int64_t slab) const;
  template <class Visit>
  void merge_points(const Visit& visit) const;
  void number_points();
  // Returns the PointBricks that can contain corners of a brick's cells. The brick is at `place` in
  // the previous slab. The element 4dx + 2dy + dz is the PointBrick at the offset (dx, dy, dz) from
  // the brick; it is null if this PointBrick has no points.
  std::array<const PointBrick*, 8> point_bricks_around(uint64_t place) const;
  static Points points_of(const std::array<const PointBrick*, 8>& around, int bit);

  const ExportJob& job_;
  const HexSlabs& slabs_;
  int64_t slab_ = -1;  // index of the current slab in slabs_
  Slab<HexBrick> bricks_, bricks_before_;
  Slab<PointBrick> points_, points_before_;
  uint64_t next_point_ = 0;
  uint64_t cells_ = 0;
};

template <class Visit>
void HexSweep::for_each_point(const Visit& visit) const {
  for (uint64_t i = 0; i < points_.count; ++i) {
    const PointBrick& points = points_.items[i];
    for_each_cell_of({corner_of(slabs_.first + slab_, points.place), points.mask}, visit);
  }
}

template <class Visit>
void HexSweep::for_each_cell(const Visit& visit) const {
  for (uint64_t i = 0; i < bricks_before_.count; ++i) {
    const HexBrick& brick = bricks_before_.items[i];
    const auto around = point_bricks_around(brick.place);
    const Position low = corner_of(slabs_.first + slab_ - 1, brick.place);
    for (uint64_t left = brick.mask; left != 0; left &= left - 1) {
      const int bit = std::countr_zero(left);
      visit(brick_cell({low, 0}, bit), points_of(around, bit));
    }
  }
}

struct HexMesh {
  HexSlabs slabs;
  uint64_t points = 0;
};

// Counts the cells and points of the mesh. If there are more than `limit` of either, throws
// Error{kLimit} with `reason`, like require_voxels().
HexMesh require_hex_mesh(const ExportJob& job, uint64_t limit, const std::string& reason);

// Returns the sizes of the mesh as a note of the report.
std::string hex_mesh_note(const HexMesh& mesh);

}  // namespace voxdag::query
