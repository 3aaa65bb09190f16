// OctoMap's octree, for the exports to .bt and .ot. The octree has 16 levels. The origin of its
// coordinates is the center of the octree. The exporter rounds the position of the grid to a whole
// number of cells, so that the origin of the octree is at most half a voxel from the origin of the
// scene. After this shift, octree cubes are in general not cubes of the grid. So the exporters read
// the cells of one octree block after the other, 32^3 cells each, and make the nodes from these
// cells.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <utility>

#include "core/geometry/morton.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {

inline constexpr uint32_t kOctoMapLevels = 16;
// Edge of an octree block, in cells. The cells of one block are in memory at the same time.
inline constexpr int64_t kBlockEdge = 32;
inline constexpr uint32_t kBlockLevels = 5;
inline constexpr int64_t kHalfTree = int64_t{1} << (kOctoMapLevels - 1);

// Throws Error{kLimit} for a grid with more levels than the octree.
void check_octomap_levels(const ExportJob& job);
// Returns the octree position of the grid's low corner, in cells from the octree's origin.
Position octomap_place(const ExportJob& job);
// Adds notes and facts to the report: the translation to the scene, the number of nodes, and the
// memory that the OctoMap library needs to read the file.
void report_octomap(const ExportJob& job, uint64_t nodes, uint64_t inner_nodes,
                    ExportReport& report);

// The content of an octree cube: no set cells, some, or only set cells.
enum class Content : uint8_t { kNothing, kSomething, kFull };

// The cells of one block of the octree, as bits in Morton order. The lowest bit of an index is the
// lowest bit of x.
class BlockCells {
 public:
  // `place` is octomap_place(job).
  BlockCells(const ExportJob& job, const Position& place) : job_(job), place_(place) {}

  // Reads the selected cells of the block whose low corner is `corner`, in cells from the octree's
  // origin. `region` is the selected part of the block, in cells of the grid. Returns the number of
  // set cells.
  uint64_t read(const Position& corner, const Region& region) {
    cells_.fill(0);
    uint64_t count = 0;
    if (region.empty()) return 0;
    for_each_brick(job_.dag, {job_.selection.grid_levels, region}, [&](const Brick& brick) {
      for_each_cell_of(brick, [&](const Position& cell) {
        std::array<uint32_t, 3> at{};
        for (size_t axis = 0; axis < 3; ++axis)
          at[axis] = static_cast<uint32_t>(cell[axis] + place_[axis] - corner[axis]);
        const uint64_t index = morton_encode(at[2], at[1], at[0]);
        cells_[index / 64] |= uint64_t{1} << index % 64;
        ++count;
      });
    });
    return count;
  }
  // Returns the content of a cube of edge^3 cells in the block. `index` is the index of the first
  // cell of the cube.
  Content content(uint64_t index, int64_t edge) const {
    const uint64_t count = cells_of_cube(edge);
    if (count < 64) {
      const uint64_t all = (uint64_t{1} << count) - 1;
      const uint64_t bits = cells_[index / 64] >> index % 64 & all;
      return bits == 0 ? Content::kNothing : bits == all ? Content::kFull : Content::kSomething;
    }
    uint64_t any = 0, all = ~uint64_t{0};
    for (uint64_t i = index / 64; i < (index + count) / 64; ++i) {
      any |= cells_[i];
      all &= cells_[i];
    }
    return any == 0 ? Content::kNothing : ~all == 0 ? Content::kFull : Content::kSomething;
  }

 private:
  const ExportJob& job_;
  const Position place_;
  std::array<uint64_t, (size_t{1} << 3 * kBlockLevels) / 64> cells_{};
};

// The selected region in the octree. Corners are in cells from the octree's origin.
class OctreeRegion {
 public:
  OctreeRegion(const ExportJob& job, const Position& place) : job_(job), place_(place) {
    for (size_t axis = 0; axis < 3; ++axis) {
      region_.low[axis] = job.selection.region.low[axis] + place[axis];
      region_.high[axis] = job.selection.region.high[axis] + place[axis];
    }
  }

  // Returns the low corner of a child. `edge` is the edge of the child.
  static Position child_corner(const Position& corner, int child, int64_t edge) {
    return {corner[0] + (child & 1 ? edge : 0), corner[1] + (child & 2 ? edge : 0),
            corner[2] + (child & 4 ? edge : 0)};
  }
  bool contains(const Position& corner, int64_t edge) const {
    return region_.contains(corner, edge);
  }
  // Returns the intersection of the selected region and the octree cube, in cells of the grid.
  Region part_of(const Position& corner, int64_t edge) const {
    Region region = job_.selection.region;
    for (size_t axis = 0; axis < 3; ++axis) {
      const int64_t low = corner[axis] - place_[axis];
      region.low[axis] = std::max(region.low[axis], low);
      region.high[axis] = std::min(region.high[axis], low + edge);
    }
    return region;
  }
  // True if the cube is only partly in the region, and some octree cube of kKnownEdge cells per
  // edge is inside both the cube and the region. Such a cube is divided, so that its parts in the
  // region can be free.
  bool has_known_part(const Position& corner, int64_t edge) const {
    if (region_.contains(corner, edge)) return false;
    for (size_t axis = 0; axis < 3; ++axis) {
      const int64_t low = std::max(region_.low[axis], corner[axis]) + kKnownEdge - 1;
      const int64_t high = std::min(region_.high[axis], corner[axis] + edge);
      if ((low & -kKnownEdge) >= (high & -kKnownEdge)) return false;
    }
    return true;
  }
  bool has_voxels(const Position& corner, int64_t edge) const {
    bool found = false;
    for_each_brick(job_.dag, {job_.selection.grid_levels, part_of(corner, edge)},
                   [&](const Brick&) { return !(found = true); });
    return found;
  }

 private:
  static constexpr int64_t kKnownEdge = 8;  // in cells

  const ExportJob& job_;
  const Position place_;
  Region region_;
};

}  // namespace voxdag::query
