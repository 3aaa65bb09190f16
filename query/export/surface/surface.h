// Finds the surface of the selected cells as rectangles. The surface consists of the faces between
// set and empty cells. Coplanar faces are merged to rectangles. If the file has colors, each
// rectangle has one color.
//
// With `--outside`, the surface has only faces that are visible from outside: the empty cell at the
// face is connected, through empty cells of the complete grid, with the space around the grid. So a
// set cell at the border of the region has no face toward a set cell outside the region.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "query/export/export_job.h"
#include "query/export/faces/brick_faces.h"
#include "query/export/faces/brick_rows.h"
#include "query/export/faces/growing_buffer.h"

namespace voxdag::query {

// Returns the name of the surface's memory in error messages. The reference remains valid.
inline const std::string& surface_memory() {
  static const std::string kName = "the surface (" + less_is_needed() + ")";
  return kName;
}

// A rectangle of faces perpendicular to `axis`. `plane` is the coordinate of the faces on this
// axis. The rectangle extends from u0 to u1 on the next axis, and from v0 to v1 on the axis after
// that; z is followed by x. All coordinates are in cells from the low corner of the region.
struct SurfaceRectangle {
  uint32_t plane = 0, u0 = 0, v0 = 0, u1 = 0, v1 = 0;
  bool upward : 1 = false;  // the outer side of the faces is toward larger coordinates
  uint8_t axis : 2 = 0;
  voxdag_reader::Rgb color;  // black if the job has no colors
};
static_assert(sizeof(SurfaceRectangle) == 24);

class Surface {
 public:
  // Finds the rectangles. Stops soon after there are more than `max_rectangles`. Throws
  // Error{kInvalidInput} if the selection has no cells.
  Surface(const ExportJob& job, uint64_t max_rectangles);

  uint64_t voxels() const { return voxels_; }
  const GrowingBuffer<SurfaceRectangle>& rectangles() const { return rectangles_; }

 private:
  // Adjacent faces of one color in a row of faces, from u0 to u1.
  struct Run {
    uint32_t u0, u1;  // in cells of the grid
    voxdag_reader::Rgb color;
  };
  // `v` is the last visited row of a plane that has faces. `rectangles` has the indices in
  // rectangles_ of the rectangles that extend to this row.
  struct PlaneRow {
    int64_t v = -2;
    std::vector<size_t> rectangles;
  };
  struct Direction {
    uint8_t axis;
    bool upward;
  };

  Selection walked() const;
  BrickRows read_bricks();
  void find(std::span<const RowBrick> bricks, Direction direction, ExportStage& stage);
  void add_slab(std::span<const RowBrick> slab, std::span<const RowBrick> next, Direction direction,
                ExportStage& stage);
  void add_brick(const RowBrick& brick, uint64_t neighbor, Direction direction);
  uint64_t visible_faces(const RowBrick& brick, uint64_t neighbor, Direction direction) const;
  voxdag_reader::Rgb color_of(const RowBrick& brick, uint8_t axis, int bit);
  void end_row(uint64_t slab, uint64_t v, Direction direction);
  void merge(const std::vector<Run>& runs, PlaneRow& last, int64_t v, uint32_t plane,
             Direction direction);
  bool is_over_limit() const { return rectangles_.size() > max_rectangles_; }

  const ExportJob& job_;
  const uint64_t max_rectangles_;
  // True if the bricks also have cells outside the region. Their faces are left out.
  const bool clips_faces_;
  voxdag_reader::ColorCursor colors_;
  uint64_t voxels_ = 0;
  uint64_t listed_bricks_ = 0;  // number of bricks that are sorted for each axis
  const std::array<BrickRowOrder, 3> orders_ = {BrickRowOrder(0), BrickRowOrder(1),
                                                BrickRowOrder(2)};
  // Runs in the current row of bricks (brick_rows.h): 4 planes with 4 rows of faces each.
  std::array<std::vector<Run>, 16> runs_;
  std::vector<size_t> row_;         // scratch of merge()
  std::array<PlaneRow, 4> planes_;  // planes of the current slab (brick_rows.h)
  GrowingBuffer<SurfaceRectangle> rectangles_;
};

}  // namespace voxdag::query
