// The interface through which a merge stores its state.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/format/artifact/artifact.h"

namespace voxdag {

// Stores the state of an unfinished merge, so that it can be resumed.
//
// A state is some hundred KB that only the merge understands. It names files of the scratch folder
// and the partial global file, all of which are synced before save(). It identifies the inputs by
// their content, so it still fits after an artifact was built again. Background threads
// call save() and release(), one after the other.
class Checkpoint {
 public:
  virtual ~Checkpoint() = default;

  // The state saved last, if there is one.
  virtual std::optional<std::vector<std::byte>> load() = 0;
  // Replaces the state; it is durable on return. From here on only the levels of the inputs above
  // `level` (with smaller numbers) are read.
  virtual void save(uint32_t level, std::span<const std::byte> state) = 0;
  // Discards the state.
  virtual void forget() = 0;
  // These bytes of the segment of an input are never read again: their space may be freed.
  virtual void release(const SegmentRange& range) = 0;
};

}  // namespace voxdag
