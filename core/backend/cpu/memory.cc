#include "core/backend/cpu/memory.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "core/base/page_buffer.h"

namespace voxdag::cpu {
namespace {

constexpr char kWhat[] = "a subvolume";
constexpr size_t kPage = size_t{4} << 10;
constexpr size_t kLargestPower = size_t{4} << 20;
// Of a budget, what is kept from one subvolume to the next at most: an eighth, or this if more.
constexpr uint64_t kKeptInAnyCase = uint64_t{8} << 20;
constexpr size_t kMostBlocks = 64;

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
  *best = kept_.back();
  kept_.pop_back();
  kept_bytes_ -= found.bytes;
  return found;
}

void PagePool::give_back(Block block, size_t most_kept) noexcept {
  if (kept_bytes_ + block.bytes <= most_kept && kept_.size() < kMostBlocks) {
    try {
      kept_.push_back(block);
      kept_bytes_ += block.bytes;
      return;
    } catch (...) {  // no memory for the list: the block goes
    }
  }
  free_pages(block.pages, block.bytes);
}

void PagePool::clear() noexcept {
  for (const Block& block : kept_) free_pages(block.pages, block.bytes);
  kept_.clear();
  kept_bytes_ = 0;
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
  pool.give_back(block, std::max(budget.limit() / 8, kKeptInAnyCase));
  budget.release(block.bytes);
}

}  // namespace voxdag::cpu
