#include "core/dag/consing/pooled_memory.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/base/page_buffer.h"
#include "core/dag/consing/consing_memory.h"

namespace voxdag {
namespace {

constexpr char kWhat[] = "a subvolume";
constexpr size_t kPage = size_t{4} << 10;
constexpr size_t kHugePage = size_t{2} << 20;
constexpr size_t kLargestPower = size_t{4} << 20;
// Maximum number of cached ranges. The build of a subvolume uses up to a few hundred arrays. With a
// lower limit, the small ranges, which are freed last, would evict the large ranges.
constexpr size_t kMaxRanges = 1024;

}  // namespace

size_t PagePool::range_bytes(size_t bytes) {
  if (bytes <= kLargestPower) return std::max(std::bit_ceil(bytes), kPage);
  return (bytes + kHugePage - 1) / kHugePage * kHugePage;
}

PagePool::Pages PagePool::take(size_t bytes, size_t max_bytes) {
  auto best = cached_.end();
  for (auto pages = cached_.begin(); pages != cached_.end(); ++pages)
    if (pages->bytes >= bytes && pages->bytes <= max_bytes &&
        (best == cached_.end() || pages->bytes < best->bytes))
      best = pages;
  if (best == cached_.end()) return {};
  const Pages found = *best;
  cached_.erase(best);
  cached_bytes_ -= found.bytes;
  return found;
}

void PagePool::put(Pages pages, size_t max_cached) noexcept {
  if (pages.bytes <= max_cached) {
    while (cached_bytes_ + pages.bytes > max_cached || cached_.size() == kMaxRanges) free_oldest();
    try {
      cached_.push_back(pages);
      cached_bytes_ += pages.bytes;
      return;
    } catch (...) {  // no memory for the list: the pages are freed
    }
  }
  free_pages(pages.data, pages.bytes);
}

void PagePool::free_oldest() noexcept {
  free_pages(cached_.front().data, cached_.front().bytes);
  cached_bytes_ -= cached_.front().bytes;
  cached_.erase(cached_.begin());
}

void PagePool::clear() noexcept {
  while (!cached_.empty()) free_oldest();
}

void PooledMemory::charge(size_t bytes) {
  if (pool.cached_bytes() + bytes > budget.available()) pool.clear();
  if (!budget.try_charge(bytes)) throw OutOfBudget{};
}

PagePool::Pages PooledMemory::allocate(size_t bytes, bool zero) {
  const size_t needed = PagePool::range_bytes(bytes);
  PagePool::Pages pages = pool.take(needed, zero ? needed : 2 * needed);
  const bool fresh = !pages.data;
  if (fresh) pages.bytes = needed;
  try {
    charge(pages.bytes);
  } catch (...) {
    if (!fresh) free_pages(pages.data, pages.bytes);
    throw;
  }
  if (!fresh) {
    if (zero) std::memset(pages.data, 0, pages.bytes);
    return pages;
  }
  try {
    pages.data = allocate_pages(pages.bytes, kWhat);
  } catch (...) {
    budget.release(pages.bytes);
    throw;
  }
  return pages;
}

bool PooledMemory::move_to_cached(PagePool::Pages& pages, size_t bytes) {
  const PagePool::Pages cached = pool.take(bytes, 2 * bytes);
  if (!cached.data) return false;
  if (pool.cached_bytes() + cached.bytes > budget.available() || !budget.try_charge(cached.bytes)) {
    free_pages(cached.data, cached.bytes);
    return false;
  }
  std::memcpy(cached.data, pages.data, pages.bytes);
  free(pages);
  pages = cached;
  return true;
}

void PooledMemory::grow(PagePool::Pages& pages, size_t bytes) {
  const size_t new_bytes = PagePool::range_bytes(bytes), more = new_bytes - pages.bytes;
  if (move_to_cached(pages, new_bytes)) return;
  // Charges only the difference. With ThreadSanitizer, grow_pages() copies the pages, so for a
  // moment the old pages also exist and are not charged.
  charge(more);
  try {
    pages.data = grow_pages(pages.data, pages.bytes, new_bytes, kWhat);
  } catch (...) {
    budget.release(more);
    throw;
  }
  pages.bytes = new_bytes;
}

void PooledMemory::free(PagePool::Pages pages) noexcept {
  pool.put(pages, ConsingMemory::page_bytes(budget.limit()));
  budget.release(pages.bytes);
}

}  // namespace voxdag
