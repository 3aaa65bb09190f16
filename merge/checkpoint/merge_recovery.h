// Makes a merge recoverable: saves how far it is, and resumes it from the state saved last.
//
// A state is saved within a pass (the artifacts merged so far replace their inputs), after a pass,
// and in the final pass after a level. Which bytes of the inputs are never read again follows from
// the state, and they are released once it is durable.
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
  // Without a checkpoint nothing is resumed or saved.
  MergeRecovery(const MergeInputs& inputs, const MergeContext& context, PendingArtifacts& pending,
                Checkpoint* checkpoint)
      : context_(context),
        grid_levels_(inputs.shape.grid_levels),
        pending_(pending),
        saver_(checkpoint, inputs.checkpoint_interval_s) {}

  // Resumes the saved state, if there is one that fits: changes `pending`, the report and `out`,
  // and returns how far the final pass is. A state that does not fit is discarded with a warning.
  PassProgress restore(GlobalFileWriter& out);

  // True if a state should be saved now. Rethrows the last save's error.
  bool due() { return saver_.due(); }
  // Within a pass: `merged`, in `segment`, replace the pending artifacts before `next`.
  void save_in_pass(PassSegment& segment, std::vector<ArtifactRef> merged, size_t next);
  // After a pass: `merged`, in `segment`, have replaced all artifacts, which were `before`.
  void save_pass(const PassSegment& segment, std::vector<ArtifactRef> merged,
                 std::span<const SurveyedArtifact> before);
  // After a level of the final pass. `readers` read the pending artifacts.
  void save_level(const PassProgress& progress, std::span<const ArtifactReader> readers,
                  GlobalFileWriter& out);
  // Waits for the save in progress, and rethrows its error.
  void wait() { saver_.wait(); }
  void finish() { saver_.finish(); }

 private:
  PassProgress resume(const MergeState& state, GlobalFileWriter& out);
  PassProgress resume_final_pass(const FinalPassState& state, GlobalFileWriter& out);
  MergeState make_state(std::vector<ArtifactRef> intermediates) const;
  // The intermediates among the pending artifacts from `begin` on.
  std::vector<ArtifactRef> intermediates_from(size_t begin) const;
  // Frames of the inputs from the bricks up to `level`, without frames returned earlier.
  std::vector<SegmentRange> newly_merged(std::span<const ArtifactReader> readers, uint32_t level);

  const MergeContext& context_;
  const uint32_t grid_levels_;
  PendingArtifacts& pending_;
  StateSaver saver_;
  std::vector<uint64_t> merged_ends_;  // where newly_merged() ended in each artifact
};

}  // namespace voxdag
