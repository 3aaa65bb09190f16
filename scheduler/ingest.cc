#include "scheduler/ingest.h"

#include <exception>
#include <span>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "core/base/error.h"
#include "core/base/slot_ring.h"

namespace voxdag {
namespace {

// A batch of the scene, snapped.
struct SnappedBatch {
  std::vector<FixedTriangle> inside;  // those that may touch the grid
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
  Taker(IngestState& state, BinWriter& writer, TopTree& top, const Seams& seams,
        const AfterBatch& after_batch)
      : state_(state), writer_(writer), top_(top), seams_(seams), after_batch_(after_batch) {}

  void take(const SnappedBatch& batch) {
    seams_.cancel.check();
    for (const FixedTriangle& triangle : batch.inside) {
      const ExpectedWork work = expected_work(triangle);
      state_.counts.expected_voxels += work.voxels;
      top_.add(triangle, work.bricks);
      writer_.append(0, triangle);
    }
    state_.counts.triangles += batch.inside.size();
    state_.counts.dropped_outside += batch.dropped_outside;
    state_.digest.add(batch.inside);
    state_.position = batch.position;
    seams_.progress.advance(batch.inside.size() + batch.dropped_outside);
    after_batch_();
  }

 private:
  IngestState& state_;
  BinWriter& writer_;
  TopTree& top_;
  const Seams& seams_;
  const AfterBatch& after_batch_;
};

void take_in_turn(TriangleSource& scene, uint64_t first, Snapper& snapper, Taker& taker) {
  SnappedBatch snapped;
  scene.for_each_batch_from(first, [&](std::span<const WorldTriangle> batch) {
    snapper.snap(batch, snapped);
    taker.take(snapped);
  });
}

// Batches on their way from one thread to the other, a third of a MiB each.
constexpr size_t kBatchesUnderWay = 3;

// The scene is read by this thread while another one takes in the batches before.
void take_at_once(TriangleSource& scene, uint64_t first, Snapper& snapper, Taker& taker) {
  struct TakerFailed {};
  SlotRing<SnappedBatch, kBatchesUnderWay> ring;
  std::exception_ptr of_taker, of_reader;
  std::thread taking;
  try {
    taking = std::thread([&] {
      try {
        for (; const SnappedBatch* batch = ring.front(); ring.pop()) taker.take(*batch);
      } catch (...) {
        of_taker = std::current_exception();
        ring.give_up();
      }
    });
  } catch (const std::system_error&) {  // the system has no thread left
    return take_in_turn(scene, first, snapper, taker);
  }
  try {
    scene.for_each_batch_from(first, [&](std::span<const WorldTriangle> batch) {
      SnappedBatch* const slot = ring.free_slot();
      if (!slot) throw TakerFailed{};
      snapper.snap(batch, *slot);
      ring.push();
    });
  } catch (const TakerFailed&) {
  } catch (...) {
    of_reader = std::current_exception();
  }
  ring.end();
  taking.join();
  if (of_taker) std::rethrow_exception(of_taker);
  if (of_reader) std::rethrow_exception(of_reader);
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

void ingest(TriangleSource& scene, unsigned threads, IngestState& state, BinWriter& writer,
            TopTree& top, const Seams& seams, const AfterBatch& after_batch) {
  seams.progress.begin_stage("ingest", state.declared_triangles, "triangles");
  seams.progress.advance(state.position);
  Snapper snapper(scene, state);
  Taker taker(state, writer, top, seams, after_batch);
  (threads > 1 ? take_at_once : take_in_turn)(scene, state.position, snapper, taker);
  writer.flush();
  state.counts.dropped_invalid =
      state.declared_triangles - state.counts.triangles - state.counts.dropped_outside;
  seams.progress.end_stage();
}

}  // namespace voxdag
