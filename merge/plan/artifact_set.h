// Artifacts that are merged together: the scheduler's, or those of an earlier round.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/format/artifact/artifact.h"
#include "merge/merge.h"

namespace voxdag {

using OpenSegment = std::function<std::shared_ptr<ReadableFile>(uint32_t)>;

struct SurveyedArtifact {
  ArtifactRef ref;
  // The memory that it takes in a merge, at least: its index, and any two neighboring frames of it
  // in a slab.
  uint64_t min_bytes = 0;
  // Checksum of its roots and its levels' rows, the same wherever it lies.
  uint64_t content = 0;
  std::vector<Cube> cubes;  // of its roots
};

struct ArtifactSurvey {
  uint64_t rows = 0;
  // In Morton order of their places: neighbors share most nodes, so a round that merges them
  // first leaves least to the next one.
  std::vector<SurveyedArtifact> by_place;
};

class ArtifactSet {
 public:
  // Opens the artifacts, each segment file once. Throws Error{kCorrupt} for one that was made for
  // another grid or other hash bits, or whose roots are not there. The indexes are charged.
  ArtifactSet(std::span<const SurveyedArtifact> artifacts, const OpenSegment& open,
              uint32_t grid_levels, uint32_t hash_bits, MemoryBudget& budget);

  std::span<const ArtifactReader> readers() const { return readers_; }

 private:
  std::vector<ArtifactReader> readers_;
  MemoryCharge charge_;
};

// Looks into all artifacts, one after the other.
ArtifactSurvey survey_artifacts(std::span<const ArtifactRef> refs, const OpenSegment& open,
                                uint32_t grid_levels, uint32_t hash_bits);

}  // namespace voxdag
