// The space of the host: its loops run on threads, and its memory is ordinary memory. space.h
// specifies the calls.
#pragma once

#include <algorithm>
#include <cstring>
#include <span>

#include "core/backend/parallel/space/space.h"
#include "core/base/memory_budget.h"
#include "core/base/parallel_for.h"
#include "core/geometry/fixed_triangle.h"
#include "voxdag/cancel_token.h"

namespace voxdag::parallel {

class HostSpace {
 public:
  static constexpr bool kOnHost = true;
  static constexpr uint64_t kWindow = uint64_t{1} << 16;
  static constexpr uint32_t kMaxTiles = 64;
  template <class T>
  using Array = SpaceArray<HostSpace, T>;

  HostSpace(MemoryBudget& budget, const CancelToken& cancel, unsigned threads)
      : budget_(budget), cancel_(cancel), threads_(threads) {}

  MemoryBudget& budget() { return budget_; }
  uint64_t available() const { return budget_.available(); }
  void* allocate(uint64_t bytes);
  void release(void* pages, uint64_t bytes);

  template <class F>
  void for_each(uint64_t n, F f) {
    for_chunks(n, [&](uint64_t begin, uint64_t end) {
      for (uint64_t i = begin; i < end; ++i) f(static_cast<uint32_t>(i));
    });
  }

  template <class Kernel>
  void for_each_thread_block(uint32_t blocks, Kernel kernel) {
    parallel_for(threads_, blocks, [&](unsigned, size_t block) {
      cancel_.check();
      typename Kernel::Shared shared;
      for (int phase = 0; phase < Kernel::kPhases; ++phase)
        for (uint32_t thread = 0; thread < Kernel::kThreads; ++thread)
          kernel(phase, static_cast<uint32_t>(block), thread, shared);
    });
  }

  template <class F>
  void expand(const uint32_t* offsets, uint32_t first, uint32_t last, uint32_t count, F f) {
    const uint32_t base = offsets[first];
    for_chunks(count, [&](uint64_t begin, uint64_t end) {
      const uint32_t from = static_cast<uint32_t>(begin) + base;
      uint32_t source = static_cast<uint32_t>(
          std::upper_bound(offsets + first, offsets + last, from) - offsets - 1);
      for (uint32_t output = from; output < end + base; ++output) {
        while (offsets[source + 1] <= output) ++source;
        f(source, output - offsets[source], output - base);
      }
    });
  }

  void scan(uint32_t* counts, uint32_t n);
  uint32_t select(const uint8_t* flags, uint32_t n, uint32_t* out);
  uint32_t merge_runs(const uint64_t* keys, const uint64_t* masks, uint32_t n, uint64_t* out_keys,
                      uint64_t* out_masks);
  uint64_t count_bits(const uint64_t* masks, uint32_t n);
  void sort_keys(Array<uint64_t>& keys, Array<uint64_t>& scratch, uint32_t n, BitRange bits);
  void sort_pairs(Array<uint64_t>& keys, Array<uint64_t>& key_scratch, Array<uint32_t>& values,
                  Array<uint32_t>& value_scratch, uint32_t n, BitRange bits);

  template <class T>
  void copy(const T* from, T* to, uint64_t n) {
    if (n > 0) std::memcpy(to, from, n * sizeof(T));
  }
  template <class T>
  void upload(const T* from, T* to, uint64_t n) {
    copy(from, to, n);
  }
  template <class T>
  void download(const T* from, T* to, uint64_t n) {
    copy(from, to, n);
  }
  template <class T>
  T value(const T* from) {
    return *from;
  }
  std::span<FixedTriangle> staging(FixedTriangle* destination, uint64_t max_count) {
    cancel_.check();
    return {destination, max_count};
  }
  void upload_staged(std::span<const FixedTriangle>, FixedTriangle*) {}

 private:
  // Calls body(begin, end) for chunks of [0, n). A single chunk runs on the thread of the caller.
  template <class Body>
  void for_chunks(uint64_t n, Body body) {
    constexpr uint64_t kChunk = 4096;
    parallel_for(threads_, (n + kChunk - 1) / kChunk, [&](unsigned, size_t chunk) {
      cancel_.check();
      body(chunk * kChunk, std::min(n, (chunk + 1) * kChunk));
    });
  }
  template <bool kWithValues>
  void radix_sort(Array<uint64_t>& keys, Array<uint64_t>& key_scratch, Array<uint32_t>* values,
                  Array<uint32_t>* value_scratch, uint32_t n, BitRange bits);
  // Returns the number of parts into which functions such as scan() divide n items: one for each
  // thread, or fewer if parts would have less than 4096 items.
  uint32_t part_count(uint32_t n) const;
  // Calls body(part, begin, end) for the items of each part.
  template <class Body>
  void for_parts(uint32_t n, Body body) {
    const uint32_t parts = part_count(n);
    parallel_for(threads_, parts, [&](unsigned, size_t p) {
      body(p, static_cast<uint32_t>(uint64_t{n} * p / parts),
           static_cast<uint32_t>(uint64_t{n} * (p + 1) / parts));
    });
  }

  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const unsigned threads_;
};

}  // namespace voxdag::parallel
