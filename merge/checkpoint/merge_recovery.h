// Makes a merge recoverable: saves its progress, and resumes it from the last saved state.
//
// A state is saved within a pass (the artifacts merged so far replace their inputs), after a pass,
// and after a level of the final pass. After a pass or a level, some bytes of the inputs are never
// read again. These bytes are released once the state is durable.
#pragma once

#include <span>
#include <vector>

#include "merge/checkpoint/state_saver.h"
#include "merge/pass/merge_pass.h"
#include "merge/plan/pending_artifacts.h"
#include "merge/types/checkpoint.h"
#include "merge/types/merge_inputs.h"

namespace voxdag {

class MergeRecovery {
 public:
  // If `checkpoint` is null, nothing is resumed or saved.
  MergeRecovery(const MergeInputs& inputs, const MergeContext& context, PendingArtifacts& pending,
                Checkpoint* checkpoint)
      : context_(context),
        grid_levels_(inputs.shape.grid_levels),
        pending_(pending),
        saver_(checkpoint, inputs.checkpoint_interval_s) {}

  // Resumes the merge from the saved state if one exists and its inputs are the same. Restores the
  // pending artifacts, the report, and the finished levels of `out`, and returns the progress of
  // the final pass (default values if that pass has no finished level). Discards a damaged state,
  // or a state of other inputs, with a warning. Throws Error{kInvalidInput} if the interrupted
  // final pass was writing to another output path, and Error{kOutOfMemory} if this merge has too
  // little memory for the artifacts of the interrupted final pass.
  PassProgress restore(GlobalFileWriter& out);

  // True if a state should be saved now; see StateSaver::is_due(). Rethrows the last save's error.
  bool is_due() { return saver_.is_due(); }
  // Saves a state within a pass: the artifacts `merged`, in `segment`, replace the pending
  // artifacts before index `next`.
  void save_in_pass(PassSegment& segment, std::vector<ArtifactRef> merged, size_t next);
  // Saves the state after a pass: the artifacts `merged`, in `segment`, have replaced all artifacts
  // of `before`.
  void save_pass(const PassSegment& segment, std::vector<ArtifactRef> merged,
                 std::span<const SurveyedArtifact> before);
  // Saves the state after a level of the final pass. `readers` read the pending artifacts.
  void save_level(const PassProgress& progress, std::span<const ArtifactReader> readers,
                  GlobalFileWriter& out);
  // Waits for the running save and rethrows its error.
  void wait() { saver_.wait(); }
  void finish() { saver_.finish(); }

 private:
  PassProgress resume(const MergeState& state, GlobalFileWriter& out);
  PassProgress resume_final_pass(const FinalPassState& state, GlobalFileWriter& out);
  MergeState make_state(std::vector<ArtifactRef> intermediates) const;
  // Returns the intermediates (outputs of earlier passes) among the artifacts of pending_, from
  // index `begin` on.
  std::vector<ArtifactRef> intermediates_from(size_t begin) const;
  // For each artifact of pending_ that is an input of the merge, returns the range of its segment
  // that contains the frames of the levels from the bricks up to `level`. Omits bytes that earlier
  // calls have returned, and ranges that are still shorter than kMinReleasedBytes.
  std::vector<SegmentRange> newly_merged(std::span<const ArtifactReader> readers, uint32_t level);

  const MergeContext& context_;
  const uint32_t grid_levels_;
  PendingArtifacts& pending_;
  StateSaver saver_;
  // For each artifact, the end (an offset in its segment) of the ranges that newly_merged() has
  // returned.
  std::vector<uint64_t> merged_ends_;
};

}  // namespace voxdag
