#include "scheduler/ingest/ingest.h"

#include <span>
#include <string>
#include <vector>

#include "core/base/bounded_queue.h"
#include "core/base/error.h"

namespace voxdag {
namespace {

// A batch of the scene after snapping.
struct SnappedBatch {
  std::vector<FixedTriangle> inside;  // those that may touch the grid
  std::vector<ExpectedWork> work;     // one for each of `inside`
  uint64_t dropped_outside = 0;
  uint64_t position = 0;  // in the scene, after the batch
};

// The producer: snaps what is read of the scene.
class Snapper {
 public:
  Snapper(const TriangleSource& scene, const IngestState& state)
      : scene_(scene),
        grid_(state.grid),
        snapped_(state.counts.triangles + state.counts.dropped_outside) {}

  void snap(std::span<const WorldTriangle> batch, SnappedBatch& out) {
    out.inside.clear();
    out.work.clear();
    out.dropped_outside = 0;
    out.position = scene_.position();
    for (const WorldTriangle& world : batch) {
      FixedTriangle triangle;
      switch (snap_triangle(grid_, world, triangle)) {
        case SnapResult::kOutside:
          ++out.dropped_outside;
          break;
        case SnapResult::kTooFar:
          throw Error(ErrorCode::kLimit,
                      "triangle " + std::to_string(snapped_) +
                          " of the scene reaches into the grid from more than 2^32 voxels away: "
                          "expected coordinates within 2^40 / 256 voxels (--bounds)");
        case SnapResult::kInside:
          out.inside.push_back(triangle);
          out.work.push_back(expected_work(triangle));
          break;
      }
      ++snapped_;
    }
  }

 private:
  const TriangleSource& scene_;
  const Grid grid_;
  uint64_t snapped_;
};

// The consumer: counts and stores what was snapped.
void consume(const SnappedBatch& batch, IngestState& state, BinWriter& writer, TopTree& top) {
  for (size_t i = 0; i < batch.inside.size(); ++i) {
    state.counts.expected_voxels += batch.work[i].voxels;
    top.add(batch.inside[i], batch.work[i].bricks);
    writer.append(0, batch.inside[i]);
  }
  state.counts.triangles += batch.inside.size();
  state.counts.dropped_outside += batch.dropped_outside;
  state.digest.add(batch.inside);
  state.position = batch.position;
}

// Batches between the two threads, less than half a MiB each.
constexpr size_t kQueuedBatches = 3;

}  // namespace

void scan(TriangleSource& scene, IngestState& state, const BuildContext& context,
          const AfterBatch& after_batch) {
  context.progress.begin_stage("scan", state.declared_triangles, "triangles");
  context.progress.advance(state.position);
  scene.for_each_batch_from(state.position, [&](std::span<const WorldTriangle> batch) {
    context.cancel.check();
    for (const WorldTriangle& triangle : batch)
      for (const auto& vertex : triangle.v) state.bounds.add(vertex);
    state.position = scene.position();
    context.progress.advance(batch.size());
    after_batch();
  });
  context.progress.end_stage();
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

void ingest(TriangleSource& scene, unsigned threads, IngestState& state, BinWriter& writer,
            TopTree& top, const BuildContext& context, const AfterBatch& after_batch) {
  context.progress.begin_stage("ingest", state.declared_triangles, "triangles");
  context.progress.advance(state.position);
  Snapper snapper(scene, state);
  const uint64_t first = state.position;
  run_producer_consumer<SnappedBatch, kQueuedBatches>(
      threads,
      [&](auto pass) {
        scene.for_each_batch_from(first, [&](std::span<const WorldTriangle> batch) {
          pass([&](SnappedBatch& snapped) { snapper.snap(batch, snapped); });
        });
      },
      [&](const SnappedBatch& batch) {
        context.cancel.check();
        consume(batch, state, writer, top);
        context.progress.advance(batch.inside.size() + batch.dropped_outside);
        after_batch();
      });
  writer.flush();
  state.counts.dropped_invalid =
      state.declared_triangles - state.counts.triangles - state.counts.dropped_outside;
  context.progress.end_stage();
}

}  // namespace voxdag
