// Finds the tiles that the first picture of a package needs. They are stored in the head of the
// package (package_index.h). The first picture is the picture of the camera with which the viewer
// begins, with an aspect ratio of 16:9. Its cells are at most 1/48 of its height wide: 15 pixels of
// 720. The viewer refines it afterwards. Like the viewer (web/viewer/tiles/first_view.js), the
// search does not know which surfaces are hidden by other surfaces.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_set>
#include <vector>

#include "query/dag/dag_view.h"
#include "query/package/package_index.h"
#include "query/render/camera.h"
#include "query/tiles/tile.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// By level of the grid: the word offsets of the roots of the tiles.
using FirstTiles = std::vector<std::unordered_set<uint64_t>>;

// Maximum number of tiles that find_first_tiles() returns.
inline constexpr size_t kMaxFirstTiles = 1500;
// Maximum width of a cell of the first picture, in heights of the picture.
inline constexpr double kFirstCellWidth = 1.0 / 48;

// Searches for the tiles that contain visible cells. If a tile is not loaded, a viewer draws the
// cells that are kCoarseLevels below the root of the tile. So it needs the tile if one of these
// cells is too wide.
class FirstTileSearch {
 public:
  // Cells of at most `width` heights of the picture are not refined.
  FirstTileSearch(const DagView& dag, const Placement& placement, double width,
                  const CancelToken& cancel)
      : dag_(dag), placement_(placement), cancel_(cancel), is_end_(dag.grid_levels(), false) {
    const Camera camera(placement, kWidth, kHeight);
    spread_ = width * kHeight * camera.pixel_spread();
    forward_ = camera.forward();
    right_ = camera.right();
    up_ = camera.up();
    slopes_ = {kWidth * camera.pixel_spread() / 2, kHeight * camera.pixel_spread() / 2};
    for (uint32_t level = 0; level + kBrickLevels < dag.grid_levels();) {
      level = tile_end(dag.grid_levels(), kPackageTileLevels, level);
      is_end_[level] = level + kBrickLevels < dag.grid_levels();
    }
  }

  FirstTiles run() {
    tiles_.assign(dag_.grid_levels(), {});
    tiles_[0].insert(0);
    visit(0, dag_.root(), {});
    return std::move(tiles_);
  }

 private:
  // Size of the picture in pixels; only the ratio matters.
  static constexpr int kWidth = 16, kHeight = 9;
  static constexpr uint32_t kCoarseLevels = 2;  // from the root of a tile to its coarse cells
  static constexpr uint64_t kCellsPerCheck = 1 << 16;
  // Half the diagonal of a cube with the edge 1, rounded up.
  static constexpr double kCubeRadius = 0.867;

  double edge_of(uint32_t level) const {
    return static_cast<double>(dag_.resolution()) / static_cast<double>(uint64_t{1} << level);
  }

  // Visits a cube whose coarse cells must possibly be refined.
  void visit(uint32_t level, uint64_t content, const Vec& low) {
    if (level + kBrickLevels >= dag_.grid_levels()) return;  // no tile begins at a brick
    if (++visited_ % kCellsPerCheck == 0) cancel_.check();
    if (!is_visible(low, edge_of(level)) ||
        !is_wide(low, edge_of(level), edge_of(level + kCoarseLevels)))
      return;
    if (is_end_[level]) {
      if (!has_wide_cell(level, content, low, kCoarseLevels)) return;
      tiles_[level].insert(content);
    }
    const DagView::Children children = dag_.children(level, content);
    for (int i = 0; i < 8; ++i)
      if (children.has(i))
        visit(level + 1, dag_.content(level, children, i), corner(low, edge_of(level + 1), i));
  }

  // True if a visible cell `depth` levels below the cube must be refined.
  bool has_wide_cell(uint32_t level, uint64_t content, const Vec& low, uint32_t depth) const {
    const double edge = edge_of(level);
    if (depth == 0) return is_visible(low, edge) && is_wide(low, edge, edge);
    const DagView::Children children = dag_.children(level, content);
    for (int i = 0; i < 8; ++i)
      if (children.has(i) && has_wide_cell(level + 1, dag_.content(level, children, i),
                                           corner(low, edge / 2, i), depth - 1))
        return true;
    return false;
  }

  static Vec corner(const Vec& low, double half, int i) {
    return low + Vec{{i & 4 ? half : 0, i & 2 ? half : 0, i & 1 ? half : 0}};
  }

  // True if a part of the cube is possibly in the picture. Tests the ball around the cube.
  bool is_visible(const Vec& low, double edge) const {
    const Vec center = low + Vec{{edge / 2, edge / 2, edge / 2}} - placement_.eye;
    const double depth = dot(center, forward_), radius = kCubeRadius * edge;
    const auto is_within = [&](const Vec& axis, double slope) {
      return std::abs(dot(center, axis)) <= depth * slope + radius * std::hypot(1, slope);
    };
    return is_within(right_, slopes_[0]) && is_within(up_, slopes_[1]);
  }

  // True if a cell with the edge `cell` is too wide at the point of the cube that is nearest to the
  // eye.
  bool is_wide(const Vec& low, double edge, double cell) const {
    Vec gap;
    for (int axis = 0; axis < 3; ++axis)
      gap[axis] = std::max(
          {low[axis] - placement_.eye[axis], 0.0, placement_.eye[axis] - low[axis] - edge});
    return cell > spread_ * length(gap);
  }

  const DagView& dag_;
  const Placement placement_;
  const CancelToken& cancel_;
  std::vector<bool> is_end_;  // by level: whether tiles that do not end with bricks end there
  Vec forward_, right_, up_;
  std::array<double, 2> slopes_{};  // tangents of half the horizontal and vertical field of view
  double spread_ = 0;               // maximum width of a cell at distance 1
  uint64_t visited_ = 0;
  FirstTiles tiles_;
};

// Returns the needed tiles of at most kPackageTileLevels levels. If there would be more than
// kMaxFirstTiles tiles, returns the tiles of a picture with larger cells. The DAG must not be
// empty. Throws Error{kCorrupt} for a damaged file, and Error{kCanceled}.
inline FirstTiles find_first_tiles(const DagView& dag, const Placement& camera,
                                   const CancelToken& cancel) {
  for (double width = kFirstCellWidth;; width *= 2) {
    FirstTiles tiles = FirstTileSearch(dag, camera, width, cancel).run();
    size_t count = 0;
    for (const auto& level : tiles) count += level.size();
    if (count <= kMaxFirstTiles) return tiles;
  }
}

}  // namespace voxdag::query
