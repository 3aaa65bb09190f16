#include "core/backend/parallel/space/host_space.h"

#include <bit>
#include <numeric>
#include <vector>

#include "core/base/page_buffer.h"

namespace voxdag::parallel {
void* HostSpace::allocate(uint64_t bytes) {
  try {
    return allocate_pages(bytes, "the parallel backend's buffers");
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kOutOfMemory) throw OutOfBudget{};
    throw;
  }
}

void HostSpace::release(void* pages, uint64_t bytes) { free_pages(pages, bytes); }

uint32_t HostSpace::part_count(uint32_t n) const {
  return std::clamp(n / 4096, uint32_t{1}, uint32_t{threads_});
}

void HostSpace::scan(uint32_t* counts, uint32_t n) {
  cancel_.check();
  const uint32_t parts = part_count(n);
  std::vector<uint32_t> sums(parts + 1);
  for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
    sums[p] = std::accumulate(counts + begin, counts + end, uint32_t{0});
  });
  std::exclusive_scan(sums.begin(), sums.end(), sums.begin(), uint32_t{0});
  for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
    std::exclusive_scan(counts + begin, counts + end, counts + begin, sums[p]);
  });
  counts[n] = sums[parts];
}

uint32_t HostSpace::select(const uint8_t* flags, uint32_t n, uint32_t* out) {
  cancel_.check();
  const uint32_t parts = part_count(n);
  std::vector<uint32_t> starts(parts + 1);
  for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
    for (uint32_t i = begin; i < end; ++i) starts[p] += flags[i] != 0;
  });
  std::exclusive_scan(starts.begin(), starts.end(), starts.begin(), uint32_t{0});
  for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
    uint32_t at = starts[p];
    for (uint32_t i = begin; i < end; ++i)
      if (flags[i]) out[at++] = i;
  });
  return starts[parts];
}

uint32_t HostSpace::merge_runs(const uint64_t* keys, const uint64_t* masks, uint32_t n,
                               uint64_t* out_keys, uint64_t* out_masks) {
  cancel_.check();
  const auto starts_run = [&](uint32_t i) { return i == 0 || keys[i] != keys[i - 1]; };
  const uint32_t parts = part_count(n);
  std::vector<uint32_t> starts(parts + 1);
  for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
    for (uint32_t i = begin; i < end; ++i) starts[p] += starts_run(i);
  });
  std::exclusive_scan(starts.begin(), starts.end(), starts.begin(), uint32_t{0});
  // The thread of a part writes all runs of equal keys that start in the part, even if they extend
  // into later parts.
  for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
    uint32_t at = starts[p], i = begin;
    while (i < end && !starts_run(i)) ++i;
    while (i < end) {
      out_keys[at] = keys[i];
      uint64_t mask = masks[i];
      while (++i < n && !starts_run(i)) mask |= masks[i];
      out_masks[at++] = mask;
    }
  });
  return starts[parts];
}

uint64_t HostSpace::count_bits(const uint64_t* masks, uint32_t n) {
  cancel_.check();
  const uint32_t parts = part_count(n);
  std::vector<uint64_t> sums(parts);
  for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
    for (uint32_t i = begin; i < end; ++i) sums[p] += std::popcount(masks[i]);
  });
  return std::accumulate(sums.begin(), sums.end(), uint64_t{0});
}

// Sorts by digits of 8 bits, the least significant digit first. In each pass, every part of the
// keys writes to separate positions, so the parts can run concurrently.
template <bool kWithValues>
void HostSpace::radix_sort(Array<uint64_t>& keys, Array<uint64_t>& key_scratch,
                           Array<uint32_t>* values, Array<uint32_t>* value_scratch, uint32_t n,
                           BitRange bits) {
  constexpr int kDigitBits = 8;
  const uint32_t parts = part_count(n);
  std::vector<uint32_t> places(parts << kDigitBits);
  for (int bit = bits.begin; bit < bits.end; bit += kDigitBits) {
    cancel_.check();
    const uint32_t digit_mask = (1u << std::min(kDigitBits, bits.end - bit)) - 1;
    const auto digit = [&](uint64_t key) { return static_cast<uint32_t>(key >> bit) & digit_mask; };
    const uint64_t* from = keys.data();
    uint64_t* to = key_scratch.data();
    std::fill(places.begin(), places.end(), 0);
    for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
      uint32_t* counts = &places[p << kDigitBits];
      for (uint32_t i = begin; i < end; ++i) ++counts[digit(from[i])];
    });
    uint32_t at = 0;
    for (uint32_t d = 0; d <= digit_mask; ++d)
      for (uint32_t p = 0; p < parts; ++p) at += std::exchange(places[p << kDigitBits | d], at);
    for_parts(n, [&](size_t p, uint32_t begin, uint32_t end) {
      uint32_t* next = &places[p << kDigitBits];
      for (uint32_t i = begin; i < end; ++i) {
        const uint32_t place = next[digit(from[i])]++;
        to[place] = from[i];
        if constexpr (kWithValues) value_scratch->data()[place] = values->data()[i];
      }
    });
    keys.swap(key_scratch);
    if constexpr (kWithValues) values->swap(*value_scratch);
  }
}

void HostSpace::sort_keys(Array<uint64_t>& keys, Array<uint64_t>& scratch, uint32_t n,
                          BitRange bits) {
  radix_sort<false>(keys, scratch, nullptr, nullptr, n, bits);
}

void HostSpace::sort_pairs(Array<uint64_t>& keys, Array<uint64_t>& key_scratch,
                           Array<uint32_t>& values, Array<uint32_t>& value_scratch, uint32_t n,
                           BitRange bits) {
  radix_sort<true>(keys, key_scratch, &values, &value_scratch, n, bits);
}

}  // namespace voxdag::parallel
