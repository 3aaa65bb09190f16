#include "bench/query/others.h"
#include "query/lookup/bricks.h"

#ifdef VOXDAG_BENCH_OPENVDB

#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/RayIntersector.h>

#include <bit>

namespace voxdag::query {

std::optional<Timings> measure_openvdb(const DagFile& dag, uint32_t grid_levels,
                                       const QuerySet& queries) {
  openvdb::initialize();
  const auto grid = openvdb::BoolGrid::create(false);
  {
    auto accessor = grid->getAccessor();
    dag.bricks({grid_levels, whole_grid(grid_levels)}, [&](const Brick& brick) {
      for (uint64_t left = brick.mask; left != 0; left &= left - 1) {
        const Position p = brick_cell(brick, std::countr_zero(left));
        accessor.setValueOn(
            openvdb::Coord(static_cast<int>(p[0]), static_cast<int>(p[1]), static_cast<int>(p[2])),
            true);
      }
    });
  }
  // OpenVDB's cells are centered at integer coordinates, so the rays below are shifted by half a
  // cell.
  Timings timings;
  const auto look_up = [&](const std::vector<Position>& points) {
    return best_of_three(points.size(), [&] {
      auto accessor = grid->getConstAccessor();
      uint64_t found = 0;
      for (const auto& [x, y, z] : points)
        found += accessor.isValueOn(
            openvdb::Coord(static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)));
      return found;
    });
  };
  timings.uniform = look_up(queries.uniform);
  timings.set_cells = look_up(queries.set_cells);
  using Intersector = openvdb::tools::VolumeRayIntersector<openvdb::BoolGrid>;
  Intersector intersector(*grid);
  timings.rays = best_of_three(queries.origins.size(), [&] {
    uint64_t found = 0;
    for (size_t i = 0; i < queries.origins.size(); ++i) {
      const auto& o = queries.origins[i];
      const auto& d = queries.directions[i];
      const Intersector::RayType ray({o[0] - 0.5, o[1] - 0.5, o[2] - 0.5}, {d[0], d[1], d[2]});
      double t0 = 0, t1 = 0;
      found += intersector.setIndexRay(ray) && intersector.march(t0, t1);
    }
    return found;
  });
  const auto box_of = [&](size_t i) {
    const Region box = box_around(queries, i);
    return openvdb::CoordBBox(static_cast<int>(box.low[0]), static_cast<int>(box.low[1]),
                              static_cast<int>(box.low[2]), static_cast<int>(box.high[0]) - 1,
                              static_cast<int>(box.high[1]) - 1, static_cast<int>(box.high[2]) - 1);
  };
  std::vector<uint8_t> cells(kBoxEdge * kBoxEdge * kBoxEdge);
  timings.boxes = measure_boxes(cells, [&](size_t i) {
    openvdb::tools::Dense<uint8_t, openvdb::tools::LayoutZYX> dense(box_of(i), cells.data());
    openvdb::tools::copyToDense(*grid, dense, true);
  });
  timings.counts = best_of_three(kBoxes, [&] {
    auto accessor = grid->getConstAccessor();
    uint64_t found = 0;
    for (size_t i = 0; i < kBoxes; ++i) {
      const openvdb::CoordBBox box = box_of(i);
      const openvdb::Coord low = box.min() & ~7, high = box.max();
      for (int x = low.x(); x <= high.x(); x += 8)
        for (int y = low.y(); y <= high.y(); y += 8)
          for (int z = low.z(); z <= high.z(); z += 8) {
            const auto* const leaf = accessor.probeConstLeaf(openvdb::Coord(x, y, z));
            if (!leaf) continue;
            if (box.isInside(leaf->getNodeBoundingBox())) {
              found += leaf->onVoxelCount();
              continue;
            }
            for (auto cell = leaf->cbeginValueOn(); cell; ++cell)
              found += box.isInside(cell.getCoord());
          }
    }
    return found;
  });
  return timings;
}

}  // namespace voxdag::query

#else

namespace voxdag::query {

std::optional<Timings> measure_openvdb(const DagFile&, uint32_t, const QuerySet&) { return {}; }

}  // namespace voxdag::query

#endif
