#include "scheduler/ingest.h"

#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace voxdag {
namespace {

// Snaps a batch; what may touch the grid goes to `inside`, the rest is counted.
void snap(std::span<const WorldTriangle> batch, IngestState& state,
          std::vector<FixedTriangle>& inside) {
  inside.clear();
  for (const WorldTriangle& world : batch) {
    FixedTriangle triangle;
    switch (snap_triangle(state.grid, world, triangle)) {
      case SnapResult::kOutside:
        ++state.counts.dropped_outside;
        break;
      case SnapResult::kTooFar:
        throw Error(ErrorCode::kLimit,
                    "triangle " +
                        std::to_string(state.counts.triangles + inside.size() +
                                       state.counts.dropped_outside) +
                        " of the scene reaches into the grid from more than 2^32 voxels away: "
                        "expected coordinates within 2^40 / 256 voxels (--bounds)");
      case SnapResult::kInside:
        inside.push_back(triangle);
        break;
    }
  }
}

}  // namespace

void scan(TriangleSource& scene, IngestState& state, const Seams& seams,
          const AfterBatch& after_batch) {
  seams.progress.begin_stage("scan", state.declared_triangles, "triangles");
  seams.progress.advance(state.position);
  scene.for_each_batch_from(state.position, [&](std::span<const WorldTriangle> batch) {
    seams.cancel.check();
    for (const WorldTriangle& triangle : batch)
      for (const auto& vertex : triangle.v) state.bounds.add(vertex);
    state.position = scene.position();
    seams.progress.advance(batch.size());
    after_batch();
  });
  seams.progress.end_stage();
}

Grid choose_grid(const GeometryOptions& options, const WorldBounds& bounds) {
  const uint32_t levels = levels_of_resolution(options.resolution);
  if (options.bounds) {
    const auto& b = *options.bounds;
    return Grid::given({b[0], b[1], b[2]}, b[3], levels);
  }
  if (options.voxel_size) return Grid::with_voxel_size(bounds, *options.voxel_size, levels);
  return Grid::around(bounds, levels);
}

void ingest(TriangleSource& scene, IngestState& state, BinWriter& writer, TopTree& top,
            const Seams& seams, const AfterBatch& after_batch) {
  seams.progress.begin_stage("ingest", state.declared_triangles, "triangles");
  seams.progress.advance(state.position);
  std::vector<FixedTriangle> inside;
  scene.for_each_batch_from(state.position, [&](std::span<const WorldTriangle> batch) {
    seams.cancel.check();
    snap(batch, state, inside);
    for (const FixedTriangle& triangle : inside) {
      state.counts.expected_voxels += expected_voxels(triangle);
      top.add(triangle);
      writer.append(0, triangle);
    }
    state.counts.triangles += inside.size();
    state.digest.add(inside);
    state.position = scene.position();
    seams.progress.advance(batch.size());
    after_batch();
  });
  writer.flush();
  state.counts.dropped_invalid =
      state.declared_triangles - state.counts.triangles - state.counts.dropped_outside;
  seams.progress.end_stage();
}

}  // namespace voxdag
