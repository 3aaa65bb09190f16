// A space is memory and the loops over it: HostSpace (threads) or CudaSpace (one stream of a GPU).
// The pipeline of Sintorn, "DAG Construction" (Eurographics 2018 tutorial), is written once, as
// templates over a space; the work on one element is a functor with a host+device operator().
//
// Both spaces have these members; pointers are into the space's own memory:
//
//   for_each(n, f)                      f(i) for i < n, in no order; f is copied
//   for_each_thread_block(n, k)         thread block kernels, see thread_block.h
//   expand(offsets, first, last, n, f)  segmented work expansion: source s owns the outputs from
//                                       offsets[s] to offsets[s + 1]; f(s, rank, output) for the n
//                                       outputs of sources [first, last), the first counted as 0
//   scan(counts, n)                     counts[0, n) to exclusive prefix sums, the sum in counts[n]
//   select(flags, n, out)               the positions whose flag is not 0, ascending; their number
//   merge_runs(keys, masks, n, ...)     reduce by key: each run of equal keys to one key and the OR
//                                       of its masks; the number of runs
//   count_bits(masks, n)                set bits in all
//   sort_keys, sort_pairs               stable radix sorts by a range of the keys' bits; the
//                                       second buffers are scratch of the same size
//   copy, upload, download              n elements within the space, from and to host memory
//   value(pointer)                      one element, on the host
//   staging(to, max_count)              host memory for triangles whose destination is `to`
//   upload_staged(area, to)             copies them to their destination
//   available()                         estimate of the bytes that can be allocated now
//   allocate, release, budget           memory; use SpaceArray
//
// Calls take effect in their order. kWindow items, or kMaxTiles tiles, are enough to occupy a
// space; kOnHost is true if its memory is the host's. A space belongs to one build and one thread.
// Canceled builds throw from any call.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "core/base/memory_budget.h"

namespace voxdag::parallel {

// Bits [begin, end) of a key; bit 0 is the lowest.
struct BitRange {
  int begin = 0;
  int end = 64;
};

// Elements of one array: positions are 32-bit.
inline constexpr uint64_t kMaxElements = uint64_t{1} << 31;

// An uninitialized array in a space, charged to the build's budget. Throws OutOfBudget.
template <class Space, class T>
class SpaceArray {
 public:
  SpaceArray() = default;
  SpaceArray(Space& space, uint64_t size) : charge_(space.budget(), 0, "buffer"), size_(size) {
    if (size > kMaxElements || !charge_.try_resize(size * sizeof(T))) throw OutOfBudget{};
    if (size > 0) data_ = static_cast<T*>(space.allocate(size * sizeof(T)));
    space_ = &space;
  }
  SpaceArray(SpaceArray&& other) noexcept { swap(other); }
  SpaceArray& operator=(SpaceArray&& other) noexcept {
    SpaceArray(std::move(other)).swap(*this);
    return *this;
  }
  ~SpaceArray() {
    if (data_) space_->release(data_, size_ * sizeof(T));
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  uint64_t size() const { return size_; }

  void swap(SpaceArray& other) noexcept {
    std::swap(space_, other.space_);
    std::swap(charge_, other.charge_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
  }
  // Makes the size `size` and preserves the first `used` elements.
  void grow(Space& space, uint64_t size, uint64_t used) {
    SpaceArray larger(space, size);
    space.copy(data_, larger.data_, used);
    swap(larger);
  }

 private:
  Space* space_ = nullptr;
  MemoryCharge charge_;
  T* data_ = nullptr;
  uint64_t size_ = 0;
};

}  // namespace voxdag::parallel
