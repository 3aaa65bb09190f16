// A space is where buffers lie and loops run: HostSpace (threads) or CudaSpace (one stream of a
// GPU). The tutorial's pipeline is written once, as templates over a space; what it does to one
// element are functors with a host+device operator().
//
// Both spaces offer, by these names, with pointers into the space's own memory:
//
//   for_each(n, f)                      f(i) for i < n, in no order; f is copied
//   for_each_block(n, k)                block kernels, see block.h
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
//   staging(to, most)                   host memory to read triangles into that belong at `to`
//   upload_staged(area, to)             sends them there
//   available()                         bytes that could be had now, about
//   allocate, release, budget           memory; use Buffer
//
// Everything happens in the order of the calls. kWindow is how many items, and
// kTilesAtOnce how many tiles, a space likes to work on at once; kOnHost says that its memory is
// the host's. A space belongs to one build and one thread. Canceled builds throw from any call.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "core/base/memory_budget.h"

namespace voxdag::parallel {

// The subvolume does not fit the budget or the device; the build answers kOutgrown.
struct Outgrown {};

// Elements of one buffer: positions are 32-bit.
inline constexpr uint64_t kMaxElements = uint64_t{1} << 31;

// An array in a space, charged to the build's budget; uninitialized. Throws Outgrown.
template <class Space, class T>
class Buffer {
 public:
  Buffer() = default;
  Buffer(Space& space, uint64_t size) : charge_(space.budget(), 0, "buffer"), size_(size) {
    if (size > kMaxElements || !charge_.try_resize(size * sizeof(T))) throw Outgrown{};
    if (size > 0) data_ = static_cast<T*>(space.allocate(size * sizeof(T)));
    space_ = &space;
  }
  Buffer(Buffer&& other) noexcept { swap(other); }
  Buffer& operator=(Buffer&& other) noexcept {
    Buffer(std::move(other)).swap(*this);
    return *this;
  }
  ~Buffer() {
    if (data_) space_->release(data_, size_ * sizeof(T));
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  uint64_t size() const { return size_; }

  void swap(Buffer& other) noexcept {
    std::swap(space_, other.space_);
    std::swap(charge_, other.charge_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
  }

 private:
  Space* space_ = nullptr;
  MemoryCharge charge_;
  T* data_ = nullptr;
  uint64_t size_ = 0;
};

}  // namespace voxdag::parallel
