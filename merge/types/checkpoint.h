// The interface through which a merge stores its state.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/format/artifact/artifact.h"

namespace voxdag {

// Stores the state of an unfinished merge, so that the merge can be resumed.
//
// A state consists of a few hundred KB that only the merge interprets. It names files of the
// scratch folder and the partial global file, all of which are synced before save(). It identifies
// the inputs by their content, so the merge can resume even if an artifact was built again.
// Background threads call save() and release(), never concurrently.
class Checkpoint {
 public:
  virtual ~Checkpoint() = default;

  // Returns the last saved state; nullopt if none exists.
  virtual std::optional<std::vector<std::byte>> load() = 0;
  // Replaces the state. The new state is durable on return. Afterwards the merge reads only the
  // input levels above `level` (with smaller numbers).
  virtual void save(uint32_t level, std::span<const std::byte> state) = 0;
  // Discards the state.
  virtual void forget() = 0;
  // Called for bytes of an input segment that are never read again. Their space may be freed.
  virtual void release(const SegmentRange& range) = 0;
};

}  // namespace voxdag
