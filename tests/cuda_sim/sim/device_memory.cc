#include "tests/cuda_sim/sim/device_memory.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "tests/cuda_sim/sim/schedule.h"
#include "tests/cuda_sim/sim/violation.h"

namespace voxdag::cuda_sim {
namespace {

// Maps zero-filled pages. Each page uses memory only after its first access.
void* map_pages(uint64_t bytes, int rights) {
  void* pages = mmap(nullptr, bytes, rights, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (pages == MAP_FAILED) {
    std::perror("cuda_sim: mmap");
    std::abort();
  }
  return pages;
}

}  // namespace

DeviceMemory::DeviceMemory()
    : base_(reinterpret_cast<uint64_t>(map_pages(kBytes, PROT_NONE))),
      page_life_(kBytes / kPage),
      dirty_(kBytes / kChunk) {
  written_ = static_cast<uint8_t*>(map_pages(kBytes, PROT_READ | PROT_WRITE));
  writer_ = static_cast<uint32_t*>(map_pages(kBytes * sizeof(uint32_t), PROT_READ | PROT_WRITE));
  free_[0] = kBytes / kPage;
}

void* DeviceMemory::take(uint64_t pages) {
  for (auto range = free_.begin(); range != free_.end(); ++range) {
    const auto [begin, count] = *range;
    if (count < pages) continue;
    free_.erase(range);
    if (count > pages) free_[begin + pages] = count - pages;
    return reinterpret_cast<void*>(base_ + begin * kPage);
  }
  return nullptr;
}

void* DeviceMemory::reserve(uint64_t bytes) {
  const uint64_t pages = bytes / kPage + 1 + kGuardPages;
  if (void* memory = take(pages)) return memory;
  end_quarantine(0);
  return take(pages);
}

void DeviceMemory::begin_life(void* memory, uint64_t bytes, int device) {
  if (free_lives_.empty()) {
    lives_.emplace_back();
    free_lives_.push_back(static_cast<uint32_t>(lives_.size()));
  }
  const uint32_t life = free_lives_.back();
  free_lives_.pop_back();
  const uint64_t begin = offset(memory);
  lives_[life - 1] = {begin, begin + bytes, device};
  std::fill_n(page_life_.begin() + static_cast<std::ptrdiff_t>(begin / kPage), bytes / kPage + 1,
              life);
}

void DeviceMemory::end_life(void* memory) {
  const uint32_t life = page_life_[offset(memory) / kPage];
  if (life == 0) violation("memory is released before its allocation ran");
  const auto [begin, end, device] = lives_[life - 1];
  spoil(memory, end - begin);
  const uint64_t pages = (end - begin) / kPage + 1;
  std::fill_n(page_life_.begin() + static_cast<std::ptrdiff_t>(begin / kPage), pages, 0);
  free_lives_.push_back(life);
  quarantine_.emplace_back(begin / kPage, pages + kGuardPages);
  end_quarantine(kQuarantineSize);
}

void DeviceMemory::reset() {
  for (uint64_t page = 0; page < page_life_.size(); ++page)
    if (const uint32_t life = page_life_[page])
      end_life(reinterpret_cast<void*>(base_ + lives_[life - 1].begin));
  end_quarantine(0);
}

// Frees the oldest ranges until `allowed` ranges are in quarantine. Joins adjacent free ranges.
void DeviceMemory::end_quarantine(size_t allowed) {
  for (; quarantine_.size() > allowed; quarantine_.pop_front()) {
    auto [begin, count] = quarantine_.front();
    auto next = free_.lower_bound(begin);
    if (next != free_.end() && next->first == begin + count) {
      count += next->second;
      next = free_.erase(next);
    }
    if (next != free_.begin() && std::prev(next)->first + std::prev(next)->second == begin)
      std::prev(next)->second += count;
    else
      free_[begin] = count;
  }
}

void DeviceMemory::open(int device) {
  device_ = device;
  open_ = true;
  if (std::exchange(closed_, false))
    mprotect(reinterpret_cast<void*>(base_), kBytes, PROT_READ | PROT_WRITE);
}

void DeviceMemory::close() {
  open_ = false;
  if (random_below(kCloseOneOf) == 0) close_now();
}

void DeviceMemory::close_now() {
  mprotect(reinterpret_cast<void*>(base_), kBytes, PROT_NONE);
  closed_ = true;
}

// Returns the current device's allocation that contains the complete range, or null.
const DeviceMemory::Life* DeviceMemory::life_at(const void* p, uint64_t bytes) const {
  const uint64_t at = offset(p);
  if (at >= kBytes) return nullptr;
  const uint32_t life = page_life_[at / kPage];
  if (life == 0) return nullptr;
  const Life& found = lives_[life - 1];
  return at >= found.begin && at + bytes <= found.end && found.device == device_ ? &found : nullptr;
}

void DeviceMemory::fault(const void* p, uint64_t bytes, const std::string& what) const {
  const uint64_t at = offset(p);
  const uint32_t life = at < kBytes ? page_life_[at / kPage] : 0;
  std::string where = ", where there is no allocation";
  if (life != 0) {
    const Life& near = lives_[life - 1];
    where = ", at " + std::to_string(static_cast<int64_t>(at - near.begin)) + " of " +
            std::to_string(near.end - near.begin) + " allocated on device " +
            std::to_string(near.device);
  }
  violation(what + " " + std::to_string(bytes) + " bytes" + where);
}

void DeviceMemory::expect_allocated(const void* p, uint64_t bytes, const std::string& what) const {
  if (bytes > 0 && !life_at(p, bytes)) fault(p, bytes, what);
}

void DeviceMemory::expect_written(const void* p, uint64_t bytes, const std::string& what) const {
  expect_allocated(p, bytes, what);
  const uint8_t* state = written_ + offset(p);
  if (bytes > 0 && std::memchr(state, 0, bytes)) fault(p, bytes, what + ", never written,");
}

void DeviceMemory::mark_dirty(uint64_t at, uint64_t bytes) {
  for (uint64_t chunk = at / kChunk; chunk <= (at + bytes - 1) / kChunk; ++chunk)
    dirty_[chunk] = true;
}

void DeviceMemory::mark_written(void* p, uint64_t bytes) {
  if (bytes == 0) return;
  mark_dirty(offset(p), bytes);
  std::memset(written_ + offset(p), 1, bytes);
}

// Skips chunks that were not written since they were last spoiled, because they still contain junk.
void DeviceMemory::spoil(void* p, uint64_t bytes) {
  const uint64_t begin = offset(p), end = begin + bytes;
  for (uint64_t chunk = begin / kChunk; chunk * kChunk < end; ++chunk) {
    if (!dirty_[chunk]) continue;
    const uint64_t from = std::max(begin, chunk * kChunk), to = std::min(end, (chunk + 1) * kChunk);
    std::memset(reinterpret_cast<void*>(base_ + from), kJunk, to - from);
    std::memset(written_ + from, 0, to - from);
    if (to - from == kChunk) dirty_[chunk] = false;
  }
}

void DeviceMemory::copy_state(const void* from, void* to, uint64_t bytes) {
  if (bytes == 0) return;
  mark_dirty(offset(to), bytes);
  std::memcpy(written_ + offset(to), written_ + offset(from), bytes);
}

void DeviceMemory::kernel_read(const void* p, uint64_t bytes, uint32_t first, uint32_t writer) {
  if (!life_at(p, bytes)) fault(p, bytes, "a kernel reads");
  const uint64_t at = offset(p);
  for (uint64_t i = at; i < at + bytes; ++i) {
    if (!written_[i]) fault(p, bytes, "a kernel reads, never written,");
    if (writer_[i] >= first && writer_[i] != writer)
      fault(p, bytes, "a race: a thread reads what another one of its launch wrote,");
  }
}

void DeviceMemory::kernel_write(void* p, uint64_t bytes, uint32_t first, uint32_t writer) {
  if (!life_at(p, bytes)) fault(p, bytes, "a kernel writes");
  const uint64_t at = offset(p);
  for (uint64_t i = at; i < at + bytes; ++i) {
    if (writer_[i] >= first && writer_[i] != writer)
      fault(p, bytes, "a race: two threads of a launch write");
    written_[i] = 1;
    writer_[i] = writer;
  }
  dirty_[at / kChunk] = true;
  dirty_[(at + bytes - 1) / kChunk] = true;
}

void DeviceMemory::forget_writers() {
  madvise(writer_, kBytes * sizeof(uint32_t), MADV_DONTNEED);  // the pages then contain zeros
}

void DeviceMemory::kernel_atomic(void* p, uint64_t bytes, uint32_t first) {
  if (!life_at(p, bytes)) fault(p, bytes, "a kernel updates");
  const uint64_t at = offset(p);
  for (uint64_t i = at; i < at + bytes; ++i) {
    if (!written_[i]) fault(p, bytes, "a kernel updates, never written,");
    if (writer_[i] >= first)
      fault(p, bytes, "a race: a thread updates what a thread of its launch wrote,");
  }
}

DeviceMemory& device_memory() {
  static DeviceMemory& memory = *new DeviceMemory;  // never deleted: static objects use it at exit
  return memory;
}

}  // namespace voxdag::cuda_sim
