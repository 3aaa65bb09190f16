#include "core/backend/cpu/memory.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/base/page_buffer.h"

namespace voxdag::cpu {
namespace {

constexpr char kWhat[] = "a subvolume";

size_t size_class(size_t bytes, size_t smallest) {
  return static_cast<size_t>(std::bit_width(bytes / smallest) - 1);
}

}  // namespace

PagePool::~PagePool() {
  for (size_t c = 0; c < kept_.size(); ++c)
    for (void* block : kept_[c]) free_pages(block, kSmallest << c);
}

size_t PagePool::block_bytes(size_t bytes) {
  if (bytes <= kLargestKept) return std::max(std::bit_ceil(bytes), kSmallest);
  return (bytes + kSmallest - 1) / kSmallest * kSmallest;
}

void* PagePool::take(size_t bytes, bool zero) {
  if (bytes > kLargestKept) return allocate_pages(bytes, kWhat);
  std::vector<void*>& kept = kept_[size_class(bytes, kSmallest)];
  if (kept.empty()) return allocate_pages(bytes, kWhat);
  void* block = kept.back();
  kept.pop_back();
  kept_bytes_ -= bytes;
  if (zero) std::memset(block, 0, bytes);
  return block;
}

void* PagePool::grow(void* block, size_t bytes, size_t new_bytes) {
  if (bytes >= kLargestKept) return grow_pages(block, bytes, new_bytes, kWhat);
  void* larger = take(new_bytes, false);
  std::memcpy(larger, block, bytes);
  give_back(block, bytes);
  return larger;
}

void PagePool::give_back(void* block, size_t bytes) noexcept {
  if (bytes <= kLargestKept && kept_bytes_ + bytes <= kMostKept) {
    try {
      kept_[size_class(bytes, kSmallest)].push_back(block);
      kept_bytes_ += bytes;
      return;
    } catch (...) {  // no memory for the list: the block goes
    }
  }
  free_pages(block, bytes);
}

}  // namespace voxdag::cpu
