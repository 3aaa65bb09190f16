#include "merge/merge.h"

#include <algorithm>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "merge/artifact_set.h"
#include "merge/level_output.h"
#include "merge/memory_plan.h"
#include "merge/round.h"
#include "merge/scratch.h"

namespace voxdag {
namespace {

// The segment file that one round writes and the next one reads.
class RoundSegment {
 public:
  RoundSegment(MergeScratch& scratch, uint32_t id, MemoryBudget& budget)
      : scratch_(scratch),
        path_(segment_path(scratch.path(), id)),
        writer_(std::in_place, scratch.files(), scratch.path(), id, budget) {}
  ~RoundSegment() {
    writer_.reset();
    try {
      scratch_.files().remove(path_);
    } catch (const Error&) {
      // Garbage in the work folder, which is cleared as a whole.
    }
  }
  RoundSegment(const RoundSegment&) = delete;
  RoundSegment& operator=(const RoundSegment&) = delete;

  SegmentWriter& writer() { return *writer_; }
  void finish() {
    writer_->flush();
    scratch_.count_written(writer_->size());
    writer_.reset();
  }
  std::shared_ptr<ReadableFile> open() const { return scratch_.files().open_read(path_); }

 private:
  MergeScratch& scratch_;
  const std::string path_;
  std::optional<SegmentWriter> writer_;
};

// How many artifacts at a time: `ends` of consecutive groups.
std::vector<size_t> group_ends(std::span<const SurveyedArtifact> artifacts, uint64_t slab_bytes) {
  std::vector<size_t> ends;
  uint64_t bytes = 0;
  for (size_t i = 0; i < artifacts.size(); ++i) {
    bytes += artifacts[i].least_bytes;
    if (i > 0 && bytes > slab_bytes) {
      ends.push_back(i);
      bytes = artifacts[i].least_bytes;
    }
  }
  ends.push_back(artifacts.size());
  return ends;
}

class Merger {
 public:
  Merger(const MergeInputs& inputs, const MergeSeams& seams, Checkpoint* checkpoint)
      : inputs_(inputs),
        seams_(seams),
        checkpoint_(checkpoint),
        open_(inputs.open_segment),
        // Rounds before the last one also hold a segment's writer.
        round_slab_bytes_(seams.plan.slab_bytes -
                          std::min(seams.plan.slab_bytes, kSegmentWriterBytes)) {}

  void run(GlobalFileWriter& out) {
    const uint64_t rows = survey(inputs_.artifacts);
    seams_.progress.begin(fit_at_once() ? rows : 2 * rows);
    for (uint32_t round = 1; !fit_at_once(); ++round) {
      const std::vector<ArtifactRef> merged = reduce(round);
      const uint64_t rows_swept = seams_.report.input_nodes;
      const uint64_t rows_left = survey(merged);
      seams_.progress.set_total(rows_swept + (fit_at_once() ? rows_left : 2 * rows_left));
    }
    merge_last(out);
    seams_.progress.end();
  }

 private:
  // Finds out about the artifacts to merge next; returns their rows.
  uint64_t survey(std::span<const ArtifactRef> refs) {
    ArtifactSurvey found = survey_artifacts(refs, open_, inputs_.grid_levels, inputs_.hash_bits);
    artifacts_ = std::move(found.by_place);
    return found.rows;
  }

  bool fit_at_once() const {
    return artifacts_.size() < 2 || group_ends(artifacts_, seams_.plan.slab_bytes).size() == 1;
  }

  std::vector<ArtifactRoot> merge(size_t begin, size_t end, uint32_t round, LevelOutput& output) {
    const ArtifactSet artifacts({artifacts_.data() + begin, end - begin}, open_,
                                inputs_.grid_levels, inputs_.hash_bits, seams_.budget);
    const RoundTask task{inputs_.grid_levels, inputs_.hash_bits, round, round == 0,
                         artifacts.readers()};
    return merge_round(seams_, task, output, checkpoint_);
  }

  // Merges groups of artifacts into one artifact each.
  std::vector<ArtifactRef> reduce(uint32_t round) {
    const std::vector<size_t> ends = group_ends(artifacts_, round_slab_bytes_);
    if (ends.size() == artifacts_.size())
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: merging any two neighbouring subvolumes takes more than " +
                      std::to_string(seams_.budget.available()) + " bytes");
    auto segment = std::make_unique<RoundSegment>(seams_.scratch, round, seams_.budget);
    std::vector<ArtifactRef> merged;
    size_t begin = 0;
    for (const size_t end : ends) {
      ArtifactWriter writer(segment->writer(), inputs_.grid_levels, inputs_.hash_bits);
      ArtifactOutput output(writer);
      const std::vector<ArtifactRoot> roots = merge(begin, end, round, output);
      merged.push_back(writer.finish(roots));
      begin = end;
    }
    segment->finish();
    ++seams_.report.rounds;
    segment_ = std::move(segment);  // the earlier round's is removed
    open_ = [this](uint32_t) { return segment_->open(); };
    return merged;
  }

  void merge_last(GlobalFileWriter& out) {
    GlobalOutput output(out);
    for (const ArtifactRoot& root : merge(0, artifacts_.size(), 0, output)) {
      seams_.report.voxels += root.voxels;
      seams_.report.svo_nodes += root.svo_nodes;
    }
    ++seams_.report.rounds;
  }

  const MergeInputs& inputs_;
  const MergeSeams& seams_;
  Checkpoint* const checkpoint_;
  OpenSegment open_;
  const uint64_t round_slab_bytes_;
  std::vector<SurveyedArtifact> artifacts_;  // to merge next
  std::unique_ptr<RoundSegment> segment_;    // that they lie in, after the first round
};

}  // namespace

MergeReport merge_sub_dags(const MergeInputs& inputs, FileSystem& files, GlobalFileWriter& out,
                           MemoryBudget& budget, unsigned threads, Progress& progress,
                           const CancelToken& cancel, Checkpoint* checkpoint) {
  MergeReport report;
  if (inputs.artifacts.empty()) return report;
  MergeScratch scratch(files, inputs.scratch_folder);
  MergeProgress rows_swept(progress);
  const MergeSeams seams{scratch,    budget, MemoryPlan::divide(budget.available(), threads),
                         rows_swept, cancel, report};
  Merger(inputs, seams, checkpoint).run(out);
  report.scratch_bytes = scratch.bytes_written();
  return report;
}

}  // namespace voxdag
