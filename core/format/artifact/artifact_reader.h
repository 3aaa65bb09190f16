// Reads one artifact. Immutable after construction: several threads may call read_frame(), each
// with a different Frame. A reader keeps the artifact's index in memory: 56 bytes per frame, which
// are not charged to a budget.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact.h"
#include "core/io/file_system.h"

namespace voxdag {

class ArtifactReader {
 public:
  // `segment` must be the file of ref.segment. Throws Error{kCorrupt} or
  // Error{kUnsupportedVersion}.
  ArtifactReader(std::shared_ptr<ReadableFile> segment, const ArtifactRef& ref);

  // Returns the segment's path and the artifact's offset in it, for messages.
  const std::string& place() const { return place_; }
  const DagShape& shape() const { return shape_; }
  std::span<const ArtifactRoot> roots() const { return roots_; }
  // The levels of the artifact, from the bricks upwards: levels()[0] is level L-2.
  std::span<const ArtifactLevel> levels() const { return levels_; }
  // Returns the level with this number; nullptr if the artifact does not have it.
  const ArtifactLevel* level(uint32_t level) const;
  // Decodes frame `index` of `level`, which must exist, and checks its rows. Throws
  // Error{kCorrupt}; the message names the segment, the level and the frame.
  void read_frame(uint32_t level, size_t index, Frame& out) const;

 private:
  [[noreturn]] void damaged(uint32_t level, size_t frame, const std::string& what) const;

  std::shared_ptr<ReadableFile> file_;
  std::string place_;
  DagShape shape_;
  std::vector<ArtifactRoot> roots_;
  std::vector<ArtifactLevel> levels_;
};

}  // namespace voxdag
