// A space is a memory with loops that work on it: HostSpace (threads) or CudaSpace (one stream of a
// GPU). The pipeline of Sintorn, "DAG Construction" (Eurographics 2018 tutorial), is written once,
// as templates over a space. The work on one element is a functor with a host+device operator().
//
// Both spaces have these members. Pointers point into the space's own memory.
//
//   for_each(n, f)                      calls f(i) for every i < n, in any order; f is copied
//   for_each_thread_block(n, k)         runs thread block kernels, see thread_block.h
//   expand(offsets, first, last, n, f)  segmented work expansion: source s owns the outputs from
//                                       offsets[s] to offsets[s + 1]. Calls f(s, rank, output) for
//                                       the n outputs of the sources [first, last); the first of
//                                       these outputs is number 0
//   scan(counts, n)                     replaces counts[0, n) by exclusive prefix sums, and writes
//                                       the total to counts[n]
//   select(flags, n, out)               writes the positions of nonzero flags, ascending; returns
//                                       their number
//   merge_runs(keys, masks, n, ...)     reduces each run of equal keys to one key and the OR of its
//                                       masks; returns the number of runs
//   count_bits(masks, n)                returns the number of set bits in all masks
//   sort_keys, sort_pairs               stable radix sorts by a range of the keys' bits; the
//                                       second buffers are scratch of the same size
//   copy, upload, download              copy n elements: within the space, from host memory, to
//                                       host memory
//   value(pointer)                      returns one element to the host
//   download_area(bytes)                returns host memory for downloads, which the next build can
//                                       reuse, or null if there is no such memory of this size. Not
//                                       in a space with kOnHost
//   begin_download(from, to, n)         copies n elements to host memory. `to` must not be read
//                                       before finish_downloads(). Not in a space with kOnHost
//   finish_downloads()                  waits for the downloads that were begun
//   staging(to, max_count)              returns host memory for triangles whose destination is `to`
//   upload_staged(area, to)             copies these triangles to their destination
//   available()                         estimates the bytes that can be allocated now
//   allocate, release, budget           memory; use SpaceArray instead
//
// Calls take effect in their order. kWindow items, or kMaxTiles tiles, are enough to keep all
// threads of a space busy. kOnHost is true if the space uses host memory. A space belongs to one
// build and one thread. Loops, scans, sorts and staging() throw if the build is canceled.
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

// Max elements of one array, because positions in arrays have 32 bits.
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
  // Changes the size to `size`. Preserves the first `used` elements; all others are uninitialized.
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
