// The grid `sdf` of .vdb and .nvdb files: a level set, which has the signed distance from each
// voxel near the surface to the surface (query/export/level_set/narrow_band.h). Only vdb.cc
// includes this file, after the headers of OpenVDB.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <set>
#include <vector>

#include "query/export/level_set/narrow_band.h"
#include "query/export/vdb/vdb_grid.h"

namespace voxdag::query {

// Like vdb_size(), for the tree of a level set. Does not count voxels.
template <class Steps>
VdbSize level_set_size(const ExportJob& job, const Selection& selection, const VdbNodeBytes& node,
                       uint64_t limit, Steps&& steps) {
  VdbSize size;
  std::set<Position> lower, upper;
  const auto add_node = [&](std::set<Position>& known, const Position& low, int shift,
                            uint64_t bytes) {
    if (known.insert({low[0] >> shift, low[1] >> shift, low[2] >> shift}).second)
      size.bytes += bytes;
  };
  const auto add_nodes = [&](const Position& low, int64_t edge) {
    steps.advance(1);
    if (edge < 128) add_node(lower, low, 7, node.lower);
    if (edge < 4096) add_node(upper, low, 12, node.upper);
    size.bytes += cells_of_cube(edge / 4096) * kRootTileBytes;
    return size.bytes <= limit;
  };
  for_each_band_part(
      job.dag, selection, job.options.band_width(),
      [&](const Position& low, const Position&, BandTile&) {
        size.bytes += node.leaf;
        ++size.leaves;
        return add_nodes(low, kBandLeafEdge);
      },
      add_nodes);
  return size;
}

// Returns the level set of the selected voxels. Leaves have exact distances, limited to the width
// of the band. In a tile of the OpenVDB tree (a cube with one value), only the sign of the value is
// right.
inline openvdb::FloatGrid::Ptr make_level_set(const ExportJob& job, uint64_t leaves) {
  const int width = job.options.band_width(), limit = 4 * width * width;
  const Region domain = band_domain(job.selection, width);
  const auto background = static_cast<float>(width * job.cell_edge());
  const auto grid = empty_vdb_grid<openvdb::FloatGrid>(job, "surface");
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  grid->setTree(std::make_shared<openvdb::FloatTree>(background));
  std::vector<float> distances(static_cast<size_t>(limit) + 1);  // index: (2 distance in cells)^2
  for (int i = 0; i <= limit; ++i)
    distances[static_cast<size_t>(i)] = static_cast<float>(std::sqrt(i) / 2 * job.cell_edge());
  ExportStage stage(job, "build grid", leaves, "leaves");
  openvdb::FloatGrid::Accessor accessor = grid->getAccessor();
  BandSquares squares;
  for_each_band_part(
      job.dag, job.selection, width,
      [&](const Position& low, const Position& at, BandTile& tile) {
        tile.distances(at, squares);
        auto* const leaf = accessor.touchLeaf(vdb_coord(low));
        for (openvdb::Index i = 0; i < squares.size(); ++i) {
          const int square = std::abs(squares[i]);
          const float distance = distances[static_cast<size_t>(square)];
          const openvdb::Coord offset = leaf->offsetToLocalCoord(i);
          if (!domain.contains({low[0] + offset[0], low[1] + offset[1], low[2] + offset[2]}, 1))
            continue;
          leaf->setValueOnly(i, squares[i] < 0 ? -distance : distance);
          leaf->setActiveState(i, square < limit);
        }
        stage.advance(1);
        return true;
      },
      [&](const Position& low, int64_t edge) {
        job.cancel.check();
        const Position last = {low[0] + edge - 1, low[1] + edge - 1, low[2] + edge - 1};
        grid->tree().sparseFill({vdb_coord(low), vdb_coord(last)}, -background, false);
        return true;
      });
  return grid;
}

}  // namespace voxdag::query
