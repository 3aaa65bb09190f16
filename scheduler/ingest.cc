#include "scheduler/ingest.h"

#include <malloc.h>

#include <span>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "scheduler/distribute.h"

namespace voxdag {
namespace {

// SHA-256 over the grid and the snapped triangles in their order.
class ContentDigest {
 public:
  explicit ContentDigest(const Grid& grid) {
    const double numbers[] = {static_cast<double>(grid.resolution()), grid.origin[0],
                              grid.origin[1], grid.origin[2], grid.edge};
    digest_.add(std::as_bytes(std::span(numbers)));
  }
  void add(const FixedTriangle& triangle) {
    batch_.push_back(triangle);
    if (batch_.size() == kBatch) flush();
  }
  std::string finish() {
    flush();
    return digest_.finish();
  }

 private:
  static constexpr size_t kBatch = 512;
  void flush() {
    digest_.add(std::as_bytes(std::span(batch_)));
    batch_.clear();
  }

  Sha256 digest_;
  std::vector<FixedTriangle> batch_;
};

}  // namespace

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
  ContentDigest digest(grid);
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
      digest.add(triangle);
    }
    seams.progress.advance(batch.size());
  });
  writer.finish();
  counts.sha256 = digest.finish();
  seams.progress.end_stage();
  return counts;
}

std::vector<QueuedSubvolume> hand_down(std::span<const StoredSubvolume> planned,
                                       uint32_t grid_levels, TriangleBins& bins, BinId bin,
                                       size_t buffer_bytes, const CancelToken& cancel) {
  std::vector<QueuedSubvolume> queue;
  std::vector<Cube> cubes;
  std::vector<BinId> leaf_bins;
  for (const StoredSubvolume& subvolume : planned) {
    leaf_bins.push_back(bins.add_bin());
    cubes.push_back(subvolume.cube);
    queue.push_back({subvolume, leaf_bins.back()});
  }
  distribute(bins, bin, CubeTree(grid_levels, Cube{}, cubes), leaf_bins, buffer_bytes, cancel);
  // Chunks of triangles are small blocks of the heap, which would keep them resident.
  malloc_trim(0);
  return queue;
}

}  // namespace voxdag
