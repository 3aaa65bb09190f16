// Artifacts that are merged together: the inputs, or artifacts of an earlier merge pass.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/format/artifact/artifact_reader.h"

namespace voxdag {

// Opens the segment file with this id.
using OpenSegment = std::function<std::shared_ptr<ReadableFile>(uint32_t)>;

struct SurveyedArtifact {
  ArtifactRef ref;
  // Minimum memory of this artifact in a merge pass: its index, and a hash partition that can hold
  // any two neighboring frames of it.
  uint64_t min_bytes = 0;
  uint64_t rows = 0;  // rows of all levels of the artifact
  // Checksum of the artifact's roots and of its levels' row counts. Does not depend on the
  // artifact's position in a file.
  uint64_t content_checksum = 0;
  std::vector<Cube> cubes;  // cubes of its roots
};

struct ArtifactSurvey {
  uint64_t rows = 0;
  // Artifacts in Morton order of their cubes. Neighbors share the most nodes, so a pass that merges
  // neighbors leaves the fewest rows for the next pass.
  std::vector<SurveyedArtifact> in_morton_order;
};

class ArtifactSet {
 public:
  // Opens the artifacts, each segment file once, and charges their indexes to the budget. Throws
  // Error{kCorrupt} for an artifact with a different grid or different hash bits, without a root,
  // or with a root whose row does not exist.
  ArtifactSet(std::span<const SurveyedArtifact> artifacts, const OpenSegment& open,
              const DagShape& shape, MemoryBudget& budget);

  std::span<const ArtifactReader> readers() const { return readers_; }

 private:
  std::vector<ArtifactReader> readers_;
  MemoryCharge charge_;
};

// Reads the indexes of all artifacts, one after another. If `wide` is set, computes the minimum
// memory for wide levels, in which a child takes two words (merge/load/row.h). Throws
// Error{kCorrupt} for the same reasons as the constructor of ArtifactSet.
ArtifactSurvey survey_artifacts(std::span<const ArtifactRef> refs, const OpenSegment& open,
                                const DagShape& shape, bool wide);

}  // namespace voxdag
