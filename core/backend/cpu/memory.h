// Claiming memory for one subvolume: what does not fit its budget means that it has outgrown it.
#pragma once

#include <cstddef>
#include <string_view>

#include "core/base/error.h"
#include "core/base/page_buffer.h"

namespace voxdag::cpu {

// Thrown and caught within the backend; becomes BuildOutcome::kOutgrown.
struct Outgrown {};

template <class T>
PageBuffer<T> claim(MemoryBudget& budget, size_t size, std::string_view what) {
  try {
    return PageBuffer<T>(budget, size, what);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kOutOfMemory) throw Outgrown{};
    throw;
  }
}

// Grows a claimed buffer to at least `size`, by a quarter or more at a time.
template <class T>
void claim_more(MemoryBudget& budget, PageBuffer<T>& buffer, size_t size, std::string_view what) {
  const size_t least = buffer.size() + buffer.size() / 4;
  if (size < least) size = least;
  if (buffer.size() == 0) {
    buffer = claim<T>(budget, size, what);
    return;
  }
  try {
    buffer.grow(size, what);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kOutOfMemory) throw Outgrown{};
    throw;
  }
}

}  // namespace voxdag::cpu
