// Finds the tiles that a viewer needs to draw a picture. A tile is needed if, without it, the first
// cell of some ray would be coarser than requested. Let a tile have its root at level l. The tile
// that refers to this root also stores a mask of 4x4x4 cells below the root (query/tiles/tile.h).
// So a viewer without the tile has the cells of levels l + 1 and l + 2. It needs the tile only for
// the cells of level l + 3 and finer levels.
#pragma once

#include <algorithm>
#include <array>
#include <set>
#include <vector>

#include "query/dag/dag_view.h"
#include "query/render/camera.h"
#include "query/tiles/tile.h"

namespace voxdag::query {

class NeededTiles {
 public:
  using Addresses = std::set<std::pair<uint32_t, uint64_t>>;

  // A cell that is at most `pixels` pixels wide is drawn as one cell.
  NeededTiles(const DagView& dag, double pixels) : dag_(dag), pixels_(pixels) {}

  // Returns kMaxTileLevels + 1 sets of tiles. Element d has the needed tiles if a tile has at most
  // d levels. Element 0 has only the tile of the root.
  std::vector<Addresses> find(const Placement& placement, int width, int height) {
    tiles_.assign(kMaxTileLevels + 1, {});
    for (Addresses& tiles : tiles_) tiles.insert({0, 0});
    marked_.fill({});
    const Camera camera(placement, width, height);
    spread_ = camera.pixel_spread();
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        ray_ = camera.ray(x + 0.5, y + 0.5);
        nearest_ = 0;
        for (int axis = 0; axis < 3; ++axis) {
          inverse_[axis] = 1 / ray_.direction[axis];
          if (ray_.direction[axis] < 0) nearest_ |= 4 >> axis;
        }
        const Span span = crossing({}, static_cast<double>(dag_.resolution()));
        if (span.enter < span.leave) visit(0, dag_.root(), {}, span);
      }
    return std::move(tiles_);
  }

 private:
  struct Span {
    double enter, leave;
  };
  Span crossing(const Vec& low, double edge) const {
    Span span{0, 1e30};
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (low[axis] - ray_.origin[axis]) * inverse_[axis];
      const double b = (low[axis] + edge - ray_.origin[axis]) * inverse_[axis];
      span.enter = std::max(span.enter, std::min(a, b));
      span.leave = std::min(span.leave, std::max(a, b));
    }
    return span;
  }

  // Records the tiles that contain the children of the cell at `level` on the current path: one
  // tile for each maximum number of levels per tile.
  void mark(uint32_t level) {
    if (level < 2) return;  // the root's tile contains these children
    const uint32_t bricks = dag_.grid_levels() - 2;
    for (uint32_t depth = 1; depth <= kMaxTileLevels; ++depth) {
      // A tile with its root at level l is needed only for cells of level l + 3 and finer levels.
      // The children are at level + 1, so the root of their tile is at level - 2 or above.
      uint32_t root = std::min(level - 2, bricks);
      while (root > 0 && (bricks - root) % depth != 0) --root;
      if (root == 0 || root == bricks) continue;
      auto& last = marked_[depth][root];
      if (last == path_[root] + 1) continue;
      last = path_[root] + 1;
      tiles_[depth].insert({root, path_[root]});
    }
  }

  // Follows the ray through the cells inside this cell, nearest first, and marks the tiles that
  // contain them. `span` is the part of the ray inside this cell. Returns true if the ray ends in
  // this cell.
  bool visit(uint32_t level, uint64_t content, const Vec& low, const Span& span) {
    const double edge = static_cast<double>(dag_.resolution()) / static_cast<double>(1ull << level);
    if (level == dag_.grid_levels() || edge <= pixels_ * spread_ * span.enter) return true;
    path_[level] = content;
    mark(level);
    const DagView::Children c = dag_.children(level, content);
    const double half = edge / 2;
    for (int n = 0; n < 8; ++n) {
      const int i = n ^ nearest_;  // nearer children first
      if (!c.has(i)) continue;
      const Span part = crossing(corner(low, half, i), half);
      if (part.enter < part.leave &&
          visit(level + 1, dag_.content(level, c, i), corner(low, half, i), part))
        return true;
    }
    return false;
  }
  static Vec corner(const Vec& low, double half, int i) {
    return low + Vec{{i & 4 ? half : 0, i & 2 ? half : 0, i & 1 ? half : 0}};
  }

  const DagView& dag_;
  const double pixels_;
  double spread_ = 0;
  Ray ray_;
  double inverse_[3] = {};
  int nearest_ = 0;                  // the child that a ray of this direction meets first
  std::array<uint64_t, 24> path_{};  // contents of the cells on the current path, by level
  // marked_[depth][level]: the content of the tile's root that was marked last, plus 1.
  std::array<std::array<uint64_t, 24>, kMaxTileLevels + 1> marked_{};
  std::vector<Addresses> tiles_;
};

}  // namespace voxdag::query
