#include "core/backend/cpu/memory.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/backend/backend_memory.h"
#include "core/base/page_buffer.h"

namespace voxdag::cpu {
namespace {

constexpr char kWhat[] = "a subvolume";
constexpr size_t kPage = size_t{4} << 10;
constexpr size_t kLargestPower = size_t{4} << 20;
// A subvolume takes up to some hundred blocks; with fewer the small ones, which come back last,
// would drive out the large.
constexpr size_t kMaxBlocks = 1024;

}  // namespace

size_t PagePool::block_bytes(size_t bytes) {
  if (bytes <= kLargestPower) return std::max(std::bit_ceil(bytes), kPage);
  return (bytes + kPage - 1) / kPage * kPage;
}

PagePool::Block PagePool::take_kept(size_t bytes, size_t most) {
  auto best = kept_.end();
  for (auto block = kept_.begin(); block != kept_.end(); ++block)
    if (block->bytes >= bytes && block->bytes <= most &&
        (best == kept_.end() || block->bytes < best->bytes))
      best = block;
  if (best == kept_.end()) return {};
  const Block found = *best;
  kept_.erase(best);
  kept_bytes_ -= found.bytes;
  return found;
}

void PagePool::give_back(Block block, size_t max_kept) noexcept {
  if (block.bytes <= max_kept) {
    while (kept_bytes_ + block.bytes > max_kept || kept_.size() == kMaxBlocks) free_oldest();
    try {
      kept_.push_back(block);
      kept_bytes_ += block.bytes;
      return;
    } catch (...) {  // no memory for the list: the block goes
    }
  }
  free_pages(block.pages, block.bytes);
}

void PagePool::free_oldest() noexcept {
  free_pages(kept_.front().pages, kept_.front().bytes);
  kept_bytes_ -= kept_.front().bytes;
  kept_.erase(kept_.begin());
}

void PagePool::clear() noexcept {
  while (!kept_.empty()) free_oldest();
}

void Memory::charge(size_t bytes) {
  if (pool.kept_bytes() + bytes > budget.available()) pool.clear();
  if (!budget.try_charge(bytes)) throw Outgrown{};
}

PagePool::Block Memory::take(size_t bytes, bool zero) {
  const size_t least = PagePool::block_bytes(bytes);
  PagePool::Block block = pool.take_kept(least, zero ? least : 2 * least);
  const bool fresh = !block.pages;
  if (fresh) block.bytes = least;
  try {
    charge(block.bytes);
  } catch (...) {
    if (!fresh) free_pages(block.pages, block.bytes);
    throw;
  }
  if (!fresh) {
    if (zero) std::memset(block.pages, 0, block.bytes);
    return block;
  }
  try {
    block.pages = allocate_pages(block.bytes, kWhat);
  } catch (...) {
    budget.release(block.bytes);
    throw;
  }
  return block;
}

void Memory::grow(PagePool::Block& block, size_t bytes) {
  const size_t new_bytes = PagePool::block_bytes(bytes), more = new_bytes - block.bytes;
  // Where the system cannot move the pages both are there for a moment; the charge is for one.
  charge(more);
  try {
    block.pages = grow_pages(block.pages, block.bytes, new_bytes, kWhat);
  } catch (...) {
    budget.release(more);
    throw;
  }
  block.bytes = new_bytes;
}

void Memory::give_back(PagePool::Block block) noexcept {
  pool.give_back(block, BackendMemory::page_bytes(budget.limit()));
  budget.release(block.bytes);
}

}  // namespace voxdag::cpu
