#include "bench/query/others.h"
#include "query/lookup/bricks.h"

#ifdef VOXDAG_BENCH_OCTOMAP

#include <octomap/octomap.h>

#include <bit>

namespace voxdag::query {

std::optional<Timings> measure_octomap(const DagFile& dag, uint32_t grid_levels,
                                       const QuerySet& queries) {
  octomap::OcTree tree(1.0);
  const auto half = static_cast<double>(int64_t{1} << (grid_levels - 1));
  // OctoMap's coordinate 0 has the key 32768, and keys have 16 bits. The middle of the grid gets
  // this key, so that grids of up to 2^16 cells per edge fit.
  const auto key_of = [&](const Position& p) {
    const int64_t zero = 32768 - (int64_t{1} << (grid_levels - 1));
    return octomap::OcTreeKey(static_cast<octomap::key_type>(p[0] + zero),
                              static_cast<octomap::key_type>(p[1] + zero),
                              static_cast<octomap::key_type>(p[2] + zero));
  };
  dag.bricks({grid_levels, whole_grid(grid_levels)}, [&](const Brick& brick) {
    for (uint64_t left = brick.mask; left != 0; left &= left - 1)
      tree.setNodeValue(key_of(brick_cell(brick, std::countr_zero(left))),
                        tree.getClampingThresMaxLog(), true);
  });
  tree.updateInnerOccupancy();
  Timings timings;
  const auto look_up = [&](const std::vector<Position>& points) {
    return best_of_three(points.size(), [&] {
      uint64_t found = 0;
      for (const Position& p : points) found += tree.search(key_of(p)) != nullptr;
      return found;
    });
  };
  timings.uniform = look_up(queries.uniform);
  timings.set_cells = look_up(queries.set_cells);
  // castRay() begins within the tree and steps from cell to cell, which is slow, so only a sample
  // of the rays is cast.
  const size_t step = std::max<size_t>(1, queries.origins.size() / 20000);
  timings.rays = best_of_three(queries.origins.size() / step, [&] {
    uint64_t found = 0;
    for (size_t i = 0; i < queries.origins.size(); i += step) {
      const auto& o = queries.origins[i];
      const auto& d = queries.directions[i];
      octomap::point3d end;
      found += tree.castRay(
          octomap::point3d(static_cast<float>(o[0] - half), static_cast<float>(o[1] - half),
                           static_cast<float>(o[2] - half)),
          octomap::point3d(static_cast<float>(d[0]), static_cast<float>(d[1]),
                           static_cast<float>(d[2])),
          end, true, 8 * half);
    }
    return found;
  });
  // Each leaf is one cell, because the tree was not pruned.
  const auto for_each_cell = [&](size_t i, const auto& visit) {
    const Region box = box_around(queries, i);
    const auto end = tree.end_leafs_bbx();
    for (auto leaf = tree.begin_leafs_bbx(
             key_of(box.low), key_of({box.high[0] - 1, box.high[1] - 1, box.high[2] - 1}));
         leaf != end; ++leaf)
      visit(leaf.getKey());
  };
  std::vector<uint8_t> cells(kBoxEdge * kBoxEdge * kBoxEdge);
  timings.boxes = measure_boxes(cells, [&](size_t i) {
    std::fill(cells.begin(), cells.end(), uint8_t{0});
    const octomap::OcTreeKey low = key_of(box_around(queries, i).low);
    for_each_cell(i, [&](const octomap::OcTreeKey& key) {
      cells[static_cast<size_t>(((key[0] - low[0]) * kBoxEdge + key[1] - low[1]) * kBoxEdge +
                                key[2] - low[2])] = 1;
    });
  });
  timings.counts = best_of_three(kBoxes, [&] {
    uint64_t found = 0;
    for (size_t i = 0; i < kBoxes; ++i)
      for_each_cell(i, [&](const octomap::OcTreeKey&) { ++found; });
    return found;
  });
  return timings;
}

}  // namespace voxdag::query

#else

namespace voxdag::query {

std::optional<Timings> measure_octomap(const DagFile&, uint32_t, const QuerySet&) { return {}; }

}  // namespace voxdag::query

#endif
