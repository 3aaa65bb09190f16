// Sorts the faces of a surface in two steps: faces go to the place of their plane in one array, and
// then the faces of each plane are sorted. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"

namespace voxdag::query {

// A face as one number, with 21 bits each for plane, v and u. Faces are in the order of these
// numbers.
inline constexpr int kFaceCoordinateBits = 21;
inline constexpr uint64_t kFaceCoordinateMask = (uint64_t{1} << kFaceCoordinateBits) - 1;
inline uint64_t face_of(uint64_t plane, uint64_t v, uint64_t u) {
  return (plane << kFaceCoordinateBits | v) << kFaceCoordinateBits | u;
}

// First, count() all faces. Then call reserve(), add() the same faces, and sort() them.
class PlaneSort {
 public:
  // Planes have numbers below `planes`. The message of an error contains `what`.
  PlaneSort(MemoryBudget& budget, uint64_t planes, const char* what);

  void count(uint64_t plane, uint64_t faces) { ends_[plane + 1] += faces; }
  // Throws Error{kOutOfMemory} if the faces do not fit in the budget.
  void reserve();
  void add(uint64_t plane, uint64_t face) { faces_[ends_[plane]++] = face; }
  // Returns all faces in order.
  std::span<const uint64_t> sort();

 private:
  MemoryBudget& budget_;
  const char* const what_;
  MemoryCharge ends_charge_;
  // While faces are added, ends_[p] is the index after the last face of plane p.
  std::vector<uint64_t> ends_;
  PageBuffer<uint64_t> faces_;
  PageBuffer<uint64_t> scratch_;  // as many elements as the plane with the most faces has
};

}  // namespace voxdag::query
