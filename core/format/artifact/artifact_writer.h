// Writes one artifact to a segment, level by level from the bricks upwards. Throws Error{kCorrupt}
// if rows violate the rules of artifact.h; the message names the segment and the level.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "core/dag/level_array.h"
#include "core/dag/sub_dag.h"
#include "core/format/artifact/segment_writer.h"

namespace voxdag {

class ArtifactWriter : public SubDagSink {
 public:
  // An ArtifactWriter must be finished or destroyed before the next one is created for the same
  // segment. If a writer is destroyed without finish(), its bytes remain in the segment, but no
  // ArtifactRef names them.
  ArtifactWriter(SegmentWriter& segment, const DagShape& shape);
  ~ArtifactWriter() override;

  void begin_level(uint32_t level);
  // Append any number of rows to the open level.
  void append_bricks(std::span<const uint64_t> masks);
  void append_nodes(const NodeLevelView& rows);
  void end_level();

  // The functions of SubDagSink. Each call adds a complete level.
  void bricks(const BrickLevelView& level) override;
  void nodes(const NodeLevelView& level) override;

  // Writes the index and returns the position of the artifact. The artifact can be read after the
  // next flush of the segment.
  ArtifactRef finish(std::span<const ArtifactRoot> roots);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
