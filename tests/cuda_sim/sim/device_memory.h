// The memory of all simulated devices: one range of addresses. The state of every byte is known:
// whether it is allocated, and whether it was written. The range has no access rights while the
// host runs.
//
//   1. Each allocation has separate pages, and can be used only by its device. Allocating and
//      releasing are operations of a stream. The memory exists from the moment the stream runs the
//      first of them until it runs the second.
//   2. Reading a byte that was never written is a violation, so the initial contents of an
//      allocation do not matter. Released memory is filled with junk immediately. Its addresses are
//      reused as late as possible.
//   3. It is a violation if two threads of one launch write the same byte, or if one of them writes
//      a byte and the other reads it afterwards, unless both use atomics.
//
// Not thread-safe: callers hold the lock of streams.h.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

namespace voxdag::cuda_sim {

class DeviceMemory {
 public:
  static constexpr uint64_t kBytes = uint64_t{1} << 30;  // of address space
  static constexpr uint64_t kPage = 4096;

  DeviceMemory();
  DeviceMemory(const DeviceMemory&) = delete;

  bool contains(const void* p) const { return offset(p) < kBytes; }

  // Returns addresses for an allocation, or null.
  void* reserve(uint64_t bytes);
  void begin_life(void* memory, uint64_t bytes, int device);
  void end_life(void* memory);
  // Ends all allocations.
  void reset();

  // open() lets the host access the memory while it runs an operation of `device`; close() forbids
  // it again. The instrumented sources of the backend check this state at every access. For all
  // other code, close() must remove the access rights of the pages. Because that is slow, it does
  // so in one of kCloseOneOf calls, at random.
  void open(int device);
  void close();
  bool is_open() const { return open_; }
  // Removes the access rights immediately, for all code.
  void close_now();

  // Operations of the device other than kernels (copies, memsets and calls of CUB) call these
  // functions for each range that they read or write, to check the range or to change its state.
  // `what` is the beginning of the message of a violation.
  void expect_allocated(const void* p, uint64_t bytes, const std::string& what) const;
  void expect_written(const void* p, uint64_t bytes, const std::string& what) const;
  void mark_written(void* p, uint64_t bytes);
  // Fills a range with junk, which counts as never written.
  void spoil(void* p, uint64_t bytes);
  // Copies the state of the bytes of one range (whether each was written) to another range.
  void copy_state(const void* from, void* to, uint64_t bytes);

  // Checks an access by a kernel's thread. `writer` is the thread's number (thread_blocks.h),
  // `first` the number of the first thread of its launch.
  void kernel_read(const void* p, uint64_t bytes, uint32_t first, uint32_t writer);
  void kernel_write(void* p, uint64_t bytes, uint32_t first, uint32_t writer);
  // Forgets which threads wrote. Call it before a launch whose thread numbers begin at 1 again.
  void forget_writers();
  void kernel_atomic(void* p, uint64_t bytes, uint32_t first);

 private:
  struct Life {
    uint64_t begin = 0, end = 0;  // offsets
    int device = 0;
  };
  static constexpr uint32_t kCloseOneOf = 2048;
  static constexpr uint64_t kGuardPages =
      16;  // unused pages behind each allocation; the rest of its last page is also unused
  static constexpr uint64_t kChunk = 16384;      // bytes for which dirty_ has one entry
  static constexpr size_t kQuarantineSize = 64;  // released ranges that wait for their next use
  static constexpr uint8_t kJunk = 0xdb;

  uint64_t offset(const void* p) const { return reinterpret_cast<uint64_t>(p) - base_; }
  const Life* life_at(const void* p, uint64_t bytes) const;
  void* take(uint64_t pages);
  void end_quarantine(size_t allowed);
  void mark_dirty(uint64_t at, uint64_t bytes);
  [[noreturn]] void fault(const void* p, uint64_t bytes, const std::string& what) const;

  uint64_t base_ = 0;
  bool open_ = false, closed_ = true;
  int device_ = 0;                   // device whose operation is running
  std::vector<uint32_t> page_life_;  // per page: index in lives_ + 1; 0: not allocated
  std::vector<Life> lives_;
  std::vector<uint32_t> free_lives_;
  std::vector<bool> dirty_;     // per chunk: true if it was written since it was spoiled
  uint8_t* written_ = nullptr;  // per byte: 1 if it was written
  uint32_t* writer_ = nullptr;  // per byte: number of the thread that wrote it last, not atomically
  std::map<uint64_t, uint64_t> free_;  // ranges of free pages: first page, number of pages
  std::deque<std::pair<uint64_t, uint64_t>> quarantine_;
};

// The only instance.
DeviceMemory& device_memory();

}  // namespace voxdag::cuda_sim
