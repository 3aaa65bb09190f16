// One merge from its inputs, or from where an earlier one was, to the global file.
//
// merger.cc merges: rounds while not all artifacts fit at once, then the last round.
// merger_state.cc saves how far that is, and goes on from there.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "merge/checkpoint/merge_journal.h"
#include "merge/output/level_output.h"
#include "merge/output/pass_segment.h"
#include "merge/plan/artifact_set.h"
#include "merge/plan/merge_pass.h"

namespace voxdag {

class Merger {
 public:
  Merger(const MergeInputs& inputs, const MergeContext& context, Checkpoint* checkpoint);
  void run(GlobalFileWriter& out);

 private:
  // Finds out about the artifacts to merge next.
  void survey(std::span<const ArtifactRef> refs);
  bool fit_at_once() const;
  uint64_t rows_swept() const;
  std::vector<ArtifactRoot> merge(std::span<const ArtifactReader> readers, bool last,
                                  LevelOutput& output,
                                  const std::function<void(const RoundProgress&)>& after_level);
  ArtifactSet open(size_t begin, size_t end) const;
  // Merges groups of artifacts into one artifact each.
  void reduce();
  void merge_last(GlobalFileWriter& out);
  // Rows of the levels that are left.
  uint64_t rows_above(std::span<const ArtifactReader> readers) const;

  // Goes on from the state that an earlier merge saved, if there is one that fits.
  void restore(GlobalFileWriter& out);
  void go_on_from(const MergeState& state, GlobalFileWriter& out);
  // Artifacts of rounds take the place of the inputs whose roots they hold.
  void replace_inputs(const std::vector<ArtifactRef>& merged);
  void go_on_in_last_round(const LastRoundState& state, GlobalFileWriter& out);
  MergeState state_of(std::vector<ArtifactRef> merged) const;
  // In the midst of a round: `merged` replace the artifacts before `next`.
  void save_round(RoundSegment& segment, std::vector<ArtifactRef> merged, size_t next);
  void save_level(const RoundProgress& progress, std::span<const ArtifactReader> readers,
                  GlobalFileWriter& out);
  // Frames of the inputs' levels down from `level`, but for those that were told of before. An
  // artifact's levels lie one after the other, the bricks first.
  std::vector<MergedBytes> take_merged(std::span<const ArtifactReader> readers, uint32_t level);
  // The levels of the inputs that are still read end above `level`, unless a round was finished:
  // then none is.
  uint32_t level_read(uint32_t level) const;
  std::vector<std::shared_ptr<ScratchPath>> segment_paths() const;

  const MergeInputs& inputs_;
  const MergeContext& context_;
  MergeCheckpointer journal_;
  const OpenSegment open_;
  const uint64_t round_slab_bytes_;
  uint64_t inputs_checksum_ = 0;
  std::vector<SurveyedArtifact> artifacts_;                     // to merge next
  uint64_t rows_ = 0;                                           // of these
  uint64_t rows_before_ = 0;                                    // swept before this merge went on
  std::map<uint32_t, std::unique_ptr<RoundSegment>> segments_;  // that artifacts lie in
  RoundProgress progress_;                                      // of the last round, when restored
  bool last_round_begun_ = false;
  std::vector<uint64_t> merged_ends_;  // of what take_merged() told of, in each artifact
};

}  // namespace voxdag
