// Sorts faces by plane and position. First, each face is stored in the part of an array that
// belongs to its plane. Then the faces of each plane are sorted. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"

namespace voxdag::query {

// Returns a face as one number: 21 bits each for its plane and for its coordinates v and u in the
// plane, highest first. Faces are sorted by these numbers.
inline constexpr int kFaceCoordinateBits = 21;
inline constexpr uint64_t kFaceCoordinateMask = (uint64_t{1} << kFaceCoordinateBits) - 1;
inline uint64_t face_of(uint64_t plane, uint64_t v, uint64_t u) {
  return (plane << kFaceCoordinateBits | v) << kFaceCoordinateBits | u;
}

// Usage: count() all faces, call reserve(), add() the same faces, and then call sort().
class PlaneSort {
 public:
  // `planes` is the number of planes. `what` names the memory in error messages.
  PlaneSort(MemoryBudget& budget, uint64_t planes, const char* what);

  void count(uint64_t plane, uint64_t faces) { ends_[plane + 1] += faces; }
  // Throws Error{kOutOfMemory} if the faces do not fit in the budget.
  void reserve();
  void add(uint64_t plane, uint64_t face) { faces_[ends_[plane]++] = face; }
  // Sorts the faces, and returns all of them in order.
  std::span<const uint64_t> sort();

 private:
  MemoryBudget& budget_;
  const char* const what_;
  MemoryCharge ends_charge_;
  // During calls of add(), ends_[p] is the index after the last face of plane p that was added.
  std::vector<uint64_t> ends_;
  PageBuffer<uint64_t> faces_;
  PageBuffer<uint64_t> scratch_;  // space for the faces of the largest plane
};

}  // namespace voxdag::query
