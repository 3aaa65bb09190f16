// The narrow band of a level set: signed distances to the surface of the set cells, for all cells
// near this surface.
//
// The surface consists of the faces between set and empty cells. All cells outside the grid are
// empty. The distance of a cell is the Euclidean distance from the cell's center to the nearest
// point of the surface. This point is on the nearest cell of the other kind (set or empty). If that
// cell is d_a cells away along axis a, then
//
//     (2 distance)^2 = sum over the axes of max(2 |d_a| - 1, 0)^2
//
// So all distances in cells are half the square root of an integer. They are exact.
//
// The band is computed in leaves, cubes of 8^3 cells, from the cells of the leaf and of a margin
// around it. The memory is constant.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "query/dag/dag_view.h"
#include "query/lookup/bricks.h"
#include "voxdag/cancel_token.h"
#include "voxdag/cells.h"

namespace voxdag::query {

inline constexpr int64_t kBandLeafEdge = 8;
inline constexpr int kMaxBandWidth = 16;

// The cells of a leaf, z varying fastest: (2 distance)^2, in cells. Negative for set cells. Numbers
// above 4 width^2 are replaced by 4 width^2; cells with this number are outside the band.
using BandSquares = std::array<int16_t, kBandLeafEdge * kBandLeafEdge * kBandLeafEdge>;

// Returns the cells for which a level set of the selection has distances: the region, and where the
// region ends at the border of the grid, also `width` cells beyond this border.
Region band_domain(const Selection& selection, int width);

// The cells of a tile and of a margin around it.
class BandTile {
 public:
  // `edge`: edge of the tile, a multiple of 8. The margin has `width` cells on all sides.
  BandTile(int64_t edge, int width);
  // Reads the cells of the tile with this low corner from the grid of 2^grid_levels cells per edge.
  void read(const DagView& dag, uint32_t grid_levels, const Position& low);
  int64_t edge() const { return edge_; }

  enum class Contents { kEmpty, kFull, kMixed };
  // Returns the contents of a leaf of the tile and of the leaf's margin. `at` is the leaf's
  // position in the tile, in cells.
  Contents contents(const Position& at) const;
  // Computes the distances of a leaf's cells.
  void distances(const Position& at, BandSquares& out);

 private:
  size_t index(const Position& at) const {
    return static_cast<size_t>((at[0] * side_ + at[1]) * side_ + at[2]);
  }
  void distances_to(bool is_set, const Position& at, BandSquares& out);

  const int64_t edge_;
  const int width_;
  const int64_t side_;           // edge of the tile with its margin
  std::vector<uint8_t> is_set_;  // the cells, z varying fastest
  std::vector<uint16_t> from_, to_;
};

// Returns the contents of a box of cells in the grid of 2^grid_levels cells per edge. The grid must
// have at least 4 cells per edge.
BandTile::Contents contents_of(const DagView& dag, uint32_t grid_levels, const Region& box);

// True if a set cell is at most `width` cells away from the selection along every axis. Otherwise
// no cell of the selection is set or in the band.
bool has_band(const DagView& dag, const Selection& selection, int width);

// The implementation of for_each_band_part().
template <class VisitLeaf, class VisitFull>
class BandWalk {
 public:
  BandWalk(const DagView& dag, const Selection& selection, int width, const VisitLeaf& visit_leaf,
           const VisitFull& visit_full)
      : dag_(dag),
        levels_(selection.grid_levels),
        width_(width),
        domain_(band_domain(selection, width)),
        visit_leaf_(visit_leaf),
        visit_full_(visit_full),
        tile_(std::clamp(int64_t{1} << levels_, kBandLeafEdge, kTileEdge), width) {}

  // Visits the grid and the cubes around it, whose cells near the grid can be in the band.
  void run() {
    const int64_t edge = std::max(int64_t{1} << levels_, kBandLeafEdge);
    for (int64_t x = -edge; x <= edge; x += edge)
      for (int64_t y = -edge; y <= edge; y += edge)
        for (int64_t z = -edge; z <= edge; z += edge)
          if (!enter({x, y, z}, edge)) return;
  }

 private:
  static constexpr int64_t kTileEdge = 64;

  // Visits a cube. Returns false if a visitor has ended the walk.
  bool enter(const Position& low, int64_t edge) {
    if (!domain_.intersects(low, edge)) return true;
    Region box{low, low};
    for (size_t a = 0; a < 3; ++a) {
      box.low[a] -= width_;
      box.high[a] += edge + width_;
    }
    const BandTile::Contents contents = contents_of(dag_, levels_, box);
    if (contents == BandTile::Contents::kEmpty) return true;
    if (contents == BandTile::Contents::kFull && domain_.contains(low, edge))
      return visit_full_(low, edge);
    if (edge == tile_.edge()) return visit_tile(low);
    for (int i = 0; i < 8; ++i)
      if (!enter(child_corner(low, i, edge / 2), edge / 2)) return false;
    return true;
  }

  bool visit_tile(const Position& low) {
    tile_.read(dag_, levels_, low);
    const int64_t edge = tile_.edge();
    for (int64_t x = 0; x < edge; x += kBandLeafEdge)
      for (int64_t y = 0; y < edge; y += kBandLeafEdge)
        for (int64_t z = 0; z < edge; z += kBandLeafEdge) {
          const Position leaf = {low[0] + x, low[1] + y, low[2] + z};
          if (!domain_.intersects(leaf, kBandLeafEdge)) continue;
          const Position at = {x, y, z};
          const BandTile::Contents contents = tile_.contents(at);
          if (contents == BandTile::Contents::kEmpty) continue;
          const bool is_full =
              contents == BandTile::Contents::kFull && domain_.contains(leaf, kBandLeafEdge);
          if (!(is_full ? visit_full_(leaf, kBandLeafEdge) : visit_leaf_(leaf, at, tile_)))
            return false;
        }
    return true;
  }

  const DagView& dag_;
  const uint32_t levels_;
  const int width_;
  const Region domain_;
  const VisitLeaf& visit_leaf_;
  const VisitFull& visit_full_;
  BandTile tile_;
};

// Visits the parts of a level set. Calls visit_leaf(low, at, tile) for each leaf with cells in the
// band, and for each leaf of set cells that extends beyond band_domain(). `low` is the leaf's low
// corner in the grid, `at` its position in the tile, and tile.distances() computes its distances.
// Calls visit_full(low, edge) for each cube in band_domain() that has only set cells, all of them
// farther from the surface than `width`. Both functions return a bool; false ends the walk.
template <class VisitLeaf, class VisitFull>
void for_each_band_part(const DagView& dag, const Selection& selection, int width,
                        const VisitLeaf& visit_leaf, const VisitFull& visit_full) {
  BandWalk(dag, selection, width, visit_leaf, visit_full).run();
}

// True if some set cell of the DAG's grid is surrounded by set cells: all its 26 neighbors are set.
bool has_inside(const DagView& dag, const CancelToken& cancel);

}  // namespace voxdag::query
