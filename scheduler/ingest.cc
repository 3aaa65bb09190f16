#include "scheduler/ingest.h"

#include "core/base/error.h"
#include "scheduler/distribute.h"

namespace voxdag {

Grid choose_grid(const GeometryOptions& options, TriangleSource& scene, const Seams& seams) {
  const uint32_t levels = levels_of_resolution(options.resolution);
  if (options.bounds) {
    const auto& b = *options.bounds;
    return Grid::given({b[0], b[1], b[2]}, b[3], levels);
  }
  WorldBounds bounds;
  seams.progress.begin_stage("scan", scene.declared_triangles(), "triangles");
  scene.for_each_batch([&](std::span<const WorldTriangle> batch) {
    seams.cancel.check();
    for (const WorldTriangle& triangle : batch)
      for (const auto& vertex : triangle.v) bounds.add(vertex);
    seams.progress.advance(batch.size());
  });
  seams.progress.end_stage();
  if (options.voxel_size) return Grid::with_voxel_size(bounds, *options.voxel_size, levels);
  return Grid::around(bounds, levels);
}

IngestCounts ingest(TriangleSource& scene, const Grid& grid, TriangleBins& bins, BinId bin,
                    TopTree& top, const Seams& seams) {
  IngestCounts counts;
  BinWriter writer(bins, {bin}, size_t{1} << 20);
  seams.progress.begin_stage("ingest", scene.declared_triangles(), "triangles");
  scene.for_each_batch([&](std::span<const WorldTriangle> batch) {
    seams.cancel.check();
    for (const WorldTriangle& world : batch) {
      FixedTriangle triangle;
      switch (snap_triangle(grid, world, triangle)) {
        case SnapResult::kOutside:
          ++counts.dropped_outside;
          continue;
        case SnapResult::kTooFar:
          throw Error(ErrorCode::kLimit,
                      "triangle " + std::to_string(counts.triangles + counts.dropped_outside) +
                          " of the scene reaches into the grid from more than 2^32 voxels away: "
                          "expected coordinates within 2^40 / 256 voxels (--bounds)");
        case SnapResult::kInside:
          break;
      }
      ++counts.triangles;
      counts.expected_voxels += expected_voxels(triangle);
      top.add(triangle);
      writer.append(0, triangle);
    }
    seams.progress.advance(batch.size());
  });
  writer.finish();
  seams.progress.end_stage();
  return counts;
}

std::vector<QueuedSubvolume> hand_down(const std::vector<SubvolumePlan>& plan, uint32_t grid_levels,
                                       TriangleBins& bins, BinId bin, size_t buffer_bytes,
                                       const CancelToken& cancel) {
  std::vector<QueuedSubvolume> queue;
  std::vector<BinId> leaf_bins;
  for (const SubvolumePlan& subvolume : plan) {
    leaf_bins.push_back(bins.add_bin());
    queue.push_back({subvolume.cube, leaf_bins.back(), subvolume.weight});
  }
  distribute(bins, bin, CubeTree(grid_levels, Cube{}, plan), leaf_bins, buffer_bytes, cancel);
  return queue;
}

}  // namespace voxdag
