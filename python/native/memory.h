// Parses the argument `memory` of the Python functions that have a memory budget.
#pragma once

#include <string>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"

namespace voxdag::python {

// Parses a memory limit and returns bytes; "" means half of the machine's memory. Throws
// Error{kInvalidInput} for malformed text and for less than 64 MiB.
inline uint64_t memory_of(const std::string& text) {
  const uint64_t bytes = text.empty() ? default_memory() : parse_size(text, "memory");
  if (bytes < kMinMemory)
    throw Error(ErrorCode::kInvalidInput,
                "memory: " + (text.empty() ? "the default is " + size_text(bytes) : text) +
                    ", expected at least 64MiB");
  return bytes;
}

}  // namespace voxdag::python
