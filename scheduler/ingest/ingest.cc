#include "scheduler/ingest/ingest.h"

#include <span>
#include <string>
#include <vector>

#include "core/base/bounded_queue.h"
#include "core/base/error.h"

namespace voxdag {
namespace {

// A batch of the scene, snapped.
struct SnappedBatch {
  std::vector<FixedTriangle> inside;  // those that may touch the grid
  std::vector<ExpectedWork> work;     // of each of these
  uint64_t dropped_outside = 0;
  uint64_t position = 0;  // of the scene, behind the batch
};

// Reads the scene: one half of the work.
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

// Counts and keeps what was snapped: the other half.
class Taker {
 public:
  Taker(IngestState& state, BinWriter& writer, TopTree& top, const BuildContext& context,
        const AfterBatch& after_batch)
      : state_(state), writer_(writer), top_(top), context_(context), after_batch_(after_batch) {}

  void take(const SnappedBatch& batch) {
    context_.cancel.check();
    for (size_t i = 0; i < batch.inside.size(); ++i) {
      state_.counts.expected_voxels += batch.work[i].voxels;
      top_.add(batch.inside[i], batch.work[i].bricks);
      writer_.append(0, batch.inside[i]);
    }
    state_.counts.triangles += batch.inside.size();
    state_.counts.dropped_outside += batch.dropped_outside;
    state_.digest.add(batch.inside);
    state_.position = batch.position;
    context_.progress.advance(batch.inside.size() + batch.dropped_outside);
    after_batch_();
  }

 private:
  IngestState& state_;
  BinWriter& writer_;
  TopTree& top_;
  const BuildContext& context_;
  const AfterBatch& after_batch_;
};

// Batches on their way from one thread to the other, less than half a MiB each.
constexpr size_t kBatchesUnderWay = 3;

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
  Taker taker(state, writer, top, context, after_batch);
  const uint64_t first = state.position;
  run_producer_consumer<SnappedBatch, kBatchesUnderWay>(
      threads,
      [&](auto pass) {
        scene.for_each_batch_from(first, [&](std::span<const WorldTriangle> batch) {
          pass([&](SnappedBatch& snapped) { snapper.snap(batch, snapped); });
        });
      },
      [&](const SnappedBatch& batch) { taker.take(batch); });
  writer.flush();
  state.counts.dropped_invalid =
      state.declared_triangles - state.counts.triangles - state.counts.dropped_outside;
  context.progress.end_stage();
}

}  // namespace voxdag
