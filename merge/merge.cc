#include "merge/merge.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "merge/checkpoint/merge_recovery.h"
#include "merge/pass/merge_pass.h"
#include "merge/plan/pending_artifacts.h"

namespace voxdag {
namespace {

// Maximum total rows of artifacts that a pass merges into one artifact. The total bounds the rows
// of each merged level, and the format allows at most 2^32 rows per level.
constexpr uint64_t kMaxArtifactRows = uint64_t{1} << 32;

// Runs merge passes until one more pass can merge all artifacts. This last pass writes the global
// file or one artifact.
class Merger {
 public:
  Merger(const MergeInputs& inputs, const MergeContext& context, uint64_t narrow_words,
         Checkpoint* checkpoint)
      : inputs_(inputs),
        context_(context),
        // All passes except the final pass also need memory for the writer of their segment.
        pass_bytes_(context.plan.partition_bytes -
                    std::min(context.plan.partition_bytes, kSegmentWriterBytes)),
        pending_(inputs, narrow_words),
        recovery_(inputs, context, pending_, checkpoint) {}

  void run(GlobalFileWriter& out) {
    PassProgress progress = recovery_.restore(out);
    context_.progress.begin(all_rows(), context_.report.input_nodes);
    if (!progress.level) run_passes();
    run_final_pass(out, std::move(progress));
    recovery_.finish();
    context_.progress.end();
  }

  ArtifactRef run(SegmentWriter& out) {
    context_.progress.begin(all_rows(), 0);
    run_passes();
    const ArtifactSet artifacts = pending_.open(0, pending_.size(), context_.budget);
    ArtifactWriter writer(out, inputs_.shape);
    ArtifactOutput output(writer);
    const PassTask task{inputs_.shape, false, artifacts.readers()};
    const std::vector<ArtifactRoot> roots = run_merge_pass(context_, task, output, {}, {});
    for (const ArtifactRoot& root : roots) {
      context_.report.voxels += root.voxels;
      context_.report.svo_nodes += root.svo_nodes;
    }
    ++context_.report.passes;
    context_.progress.end();
    return writer.finish(roots);
  }

 private:
  bool fit_at_once() const { return pending_.fit_at_once(context_.plan.partition_bytes); }

  uint64_t all_rows() const {
    return context_.report.input_nodes + (fit_at_once() ? 1 : 2) * pending_.rows();
  }

  // Runs passes until one pass can merge all pending artifacts.
  void run_passes() {
    while (!fit_at_once()) {
      run_pass();
      context_.progress.set_total(all_rows());
    }
  }

  // Merges groups of neighboring artifacts into one artifact each.
  void run_pass() {
    const std::vector<size_t> ends = pending_.group_ends(pass_bytes_, kMaxArtifactRows);
    if (ends.size() == pending_.size()) {
      const bool too_many_rows =
          pending_.group_ends(UINT64_MAX, kMaxArtifactRows).size() == pending_.size();
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: merging " +
                      std::string(too_many_rows ? "all subvolumes, any two of which have over 2^32 "
                                                  "rows,"
                                                : "any two neighboring subvolumes") +
                      " takes more than " + size_text(context_.budget.available()) +
                      ": expected more memory (" + option_text("memory") + ")");
    }
    PassSegment& segment =
        pending_.add_segment(std::make_unique<PassSegment>(context_.scratch, context_.budget));
    std::vector<ArtifactRef> merged;
    size_t begin = 0;
    for (const size_t end : ends) {
      ArtifactWriter writer(segment.writer(), inputs_.shape);
      ArtifactOutput output(writer);
      const ArtifactSet group = pending_.open(begin, end, context_.budget);
      const PassTask task{inputs_.shape, false, group.readers()};
      merged.push_back(writer.finish(run_merge_pass(context_, task, output, {}, {})));
      begin = end;
      if (begin < pending_.size() && recovery_.is_due())
        recovery_.save_in_pass(segment, merged, begin);
    }
    segment.finish();
    ++context_.report.passes;
    // Waits for a running save, because is_due() would return false during it. Then the save after
    // this pass could be skipped, and the input bytes that the pass has merged would not be
    // released.
    recovery_.wait();
    const bool is_due = recovery_.is_due();
    const std::vector<SurveyedArtifact> before = pending_.replace_all(merged, segment);
    if (is_due) recovery_.save_pass(segment, merged, before);
  }

  void run_final_pass(GlobalFileWriter& out, PassProgress progress) {
    GlobalOutput output(out);
    const ArtifactSet artifacts = pending_.open(0, pending_.size(), context_.budget);
    if (progress.level)
      context_.progress.set_total(context_.report.input_nodes +
                                  rows_above(*progress.level, artifacts.readers()));
    const auto after_level = [&](const PassProgress& done) {
      if (recovery_.is_due()) recovery_.save_level(done, artifacts.readers(), out);
    };
    const PassTask task{inputs_.shape, true, artifacts.readers()};
    for (const ArtifactRoot& root :
         run_merge_pass(context_, task, output, std::move(progress), after_level)) {
      context_.report.voxels += root.voxels;
      context_.report.svo_nodes += root.svo_nodes;
    }
    ++context_.report.passes;
  }

  // Returns the number of rows of the levels above `level`.
  static uint64_t rows_above(uint32_t level, std::span<const ArtifactReader> readers) {
    uint64_t rows = 0;
    for (const ArtifactReader& reader : readers)
      for (const ArtifactLevel& l : reader.levels())
        if (l.level < level) rows += l.rows;
    return rows;
  }

  const MergeInputs& inputs_;
  const MergeContext& context_;
  const uint64_t pass_bytes_;
  PendingArtifacts pending_;
  MergeRecovery recovery_;
};

MergeMemory plan_of(const MergeInputs& inputs, const MemoryBudget& budget, unsigned threads) {
  return MergeMemory::divide(budget.available(), threads, inputs.useful_partition_bytes);
}

}  // namespace

MergeReport merge_sub_dags(const MergeInputs& inputs, FileSystem& files, GlobalFileWriter& out,
                           MemoryBudget& budget, unsigned threads, Progress& progress,
                           const CancelToken& cancel, Checkpoint* checkpoint) {
  MergeReport report;
  if (inputs.artifacts.empty()) return report;
  ScratchFolder scratch(files, inputs.scratch_folder);
  MergeProgress rows_merged(progress);
  const MergeContext context{scratch,     budget, plan_of(inputs, budget, threads),
                             rows_merged, cancel, report};
  Merger(inputs, context, out.narrow_words(), checkpoint).run(out);
  report.scratch_bytes += scratch.bytes_written();
  return report;
}

ArtifactRef merge_to_artifact(const MergeInputs& inputs, FileSystem& files, SegmentWriter& out,
                              MemoryBudget& budget, unsigned threads, Progress& progress,
                              const CancelToken& cancel, MergeReport& report) {
  ScratchFolder scratch(files, inputs.scratch_folder);
  MergeProgress rows_merged(progress);
  const MergeContext context{scratch,     budget, plan_of(inputs, budget, threads),
                             rows_merged, cancel, report};
  // With a `narrow_words` of UINT64_MAX no level is wide: positions in an artifact are row indices,
  // which have 32 bits.
  const ArtifactRef merged = Merger(inputs, context, UINT64_MAX, nullptr).run(out);
  report.scratch_bytes += scratch.bytes_written();
  return merged;
}

}  // namespace voxdag
