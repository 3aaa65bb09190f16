#include "scheduler/plan/pilot.h"

#include "core/base/clock.h"

namespace voxdag {
namespace {

// The same triangles on a grid that is 2^shift times coarser; coordinates stay odd.
class CoarserStream : public TriangleStream {
 public:
  CoarserStream(std::unique_ptr<TriangleStream> fine, uint32_t shift)
      : fine_(std::move(fine)), shift_(shift) {}
  uint64_t count() const override { return fine_->count(); }
  void rewind() override { fine_->rewind(); }
  size_t read(std::span<FixedTriangle> out) override {
    const size_t n = fine_->read(out);
    for (FixedTriangle& triangle : out.first(n))
      for (auto& vertex : triangle.v)
        for (int64_t& u : vertex) u = (u >> shift_) | 1;
    return n;
  }

 private:
  std::unique_ptr<TriangleStream> fine_;
  const uint32_t shift_;
};

class CountingSink : public SubDagSink {
 public:
  void bricks(const BrickLevelView& level) override { words += 2 * level.masks.size(); }
  void nodes(const NodeLevelView& level) override {
    words += level.masks.size() + level.children.size();
  }
  uint64_t words = 0;
};

}  // namespace

std::optional<PilotCounts> build_pilot(const TriangleStore& triangles, uint32_t grid_levels,
                                       uint32_t pilot_levels, Backend& backend,
                                       MemoryBudget& budget, const CancelToken& cancel) {
  const double start = thread_cpu_seconds();
  CoarserStream stream(triangles.open(kSceneBin), grid_levels - pilot_levels);
  CountingSink sink;
  SubDagSummary summary;
  if (backend.build({pilot_levels, Cube{}, 64}, stream, budget, cancel, sink, summary) ==
      BuildOutcome::kNeedsSplit)
    return std::nullopt;
  PilotCounts counts;
  counts.levels = pilot_levels;
  counts.voxels = static_cast<double>(summary.voxels);
  counts.svo_nodes = static_cast<double>(summary.svo_nodes);
  counts.dag_nodes = static_cast<double>(summary.dag_nodes);
  counts.file_bytes = 4.0 * static_cast<double>(sink.words);
  counts.cpu_s = thread_cpu_seconds() - start;
  return counts;
}

}  // namespace voxdag
