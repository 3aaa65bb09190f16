// The artifacts that the next merge pass reads. At first these are the inputs. A pass replaces the
// artifacts that it merged by the artifacts that it wrote (*intermediates*). This class also owns
// the segment files of the intermediates.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "merge/output/pass_segment.h"
#include "merge/plan/artifact_set.h"
#include "merge/types/merge_inputs.h"

namespace voxdag {

class PendingArtifacts {
 public:
  // Starts with all inputs. A level of the output is wide if it has more than `narrow_words` words.
  // Throws Error{kCorrupt} as survey_artifacts() does.
  PendingArtifacts(const MergeInputs& inputs, uint64_t narrow_words);
  PendingArtifacts(const PendingArtifacts&) = delete;
  PendingArtifacts& operator=(const PendingArtifacts&) = delete;

  // Returns the pending artifacts in Morton order.
  std::span<const SurveyedArtifact> artifacts() const { return artifacts_; }
  size_t size() const { return artifacts_.size(); }
  // Returns the number of rows of all pending artifacts.
  uint64_t rows() const { return rows_; }
  bool has_inputs() const;
  // Returns a checksum that identifies the inputs by their content.
  uint64_t inputs_checksum() const { return inputs_checksum_; }
  // Divides the artifacts into consecutive groups and returns the groups' ends. Each group has at
  // least one artifact. A group of several artifacts can be merged within `partition_bytes` and has
  // at most `max_rows` rows.
  std::vector<size_t> group_ends(uint64_t partition_bytes, uint64_t max_rows) const;
  bool fit_at_once(uint64_t partition_bytes) const {
    return size() < 2 || group_ends(partition_bytes, UINT64_MAX).size() == 1;
  }
  ArtifactSet open(size_t begin, size_t end, MemoryBudget& budget) const;

  // Adds the segment that a pass writes next.
  PassSegment& add_segment(std::unique_ptr<PassSegment> segment);
  // Returns the scratch files of all segments.
  std::vector<std::shared_ptr<ScratchPath>> segment_paths() const;
  // Replaces all artifacts by `merged`, the artifacts that a pass has written to `segment`. Returns
  // the replaced artifacts.
  std::vector<SurveyedArtifact> replace_all(const std::vector<ArtifactRef>& merged,
                                            const PassSegment& segment);
  // For a merge that is resumed: replaces inputs by the `intermediates` with the same roots. The
  // segments of the intermediates must have been added before.
  void replace_inputs(const std::vector<ArtifactRef>& intermediates);
  // Goes back to all inputs, without intermediates.
  void reset();

 private:
  void survey(std::span<const ArtifactRef> refs);

  const MergeInputs& inputs_;
  const uint64_t narrow_words_;
  const OpenSegment open_;
  std::map<uint32_t, std::unique_ptr<PassSegment>> segments_;
  std::vector<SurveyedArtifact> artifacts_;
  uint64_t rows_ = 0;
  uint64_t inputs_checksum_ = 0;
};

}  // namespace voxdag
