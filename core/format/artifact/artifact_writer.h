// Writes one artifact to a segment, level by level from the bricks upwards. Each call adds any
// number of rows. Throws Error{kCorrupt} with segment and level if rows violate the rules of
// artifact.h.
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
  // A segment has at most one ArtifactWriter at a time. A writer destroyed without finish() leaves
  // unreferenced bytes in the segment.
  ArtifactWriter(SegmentWriter& segment, const DagShape& shape);
  ~ArtifactWriter() override;

  void begin_level(uint32_t level);
  void append_bricks(std::span<const uint64_t> masks);
  void append_nodes(const NodeLevelView& rows);
  void end_level();

  // The functions of SubDagSink. Each call adds a complete level.
  void bricks(const BrickLevelView& level) override;
  void nodes(const NodeLevelView& level) override;

  // Writes the index. The artifact can be read after the next flush of the segment.
  ArtifactRef finish(std::span<const ArtifactRoot> roots);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
