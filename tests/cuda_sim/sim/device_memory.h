// The memory of all simulated devices: one range of addresses that has no access rights while the
// host runs, and in which every byte is known to be allocated or not, written or not.
//
//   1. Each allocation has separate pages. It lives from the moment its allocation executes in
//      stream order until its release does, and can be used by its device only.
//   2. Reading a byte that was never written is a violation, so what fresh memory contains does not
//      matter. Released memory is junk immediately, and its addresses are reused late.
//   3. Two threads of a launch that are not ordered write no byte twice, and read none that the
//      other wrote, unless both use atomics.
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
  static constexpr uint64_t kBytes = uint64_t{1} << 30;  // of addresses
  static constexpr uint64_t kPage = 4096;

  DeviceMemory();
  DeviceMemory(const DeviceMemory&) = delete;

  bool contains(const void* p) const { return offset(p) < kBytes; }

  // Returns addresses for an allocation, or null.
  void* reserve(uint64_t bytes);
  void begin_life(void* memory, uint64_t bytes, int device);
  void end_life(void* memory);
  // Ends all lives.
  void reset();

  // Gives access for operations of a device, and revokes it: for instrumented code of the backend's
  // sources every time, for all code one time in kCloseOneOf, because that is slow.
  void open(int device);
  void close();
  bool is_open() const { return open_; }
  // Takes it away from all code.
  void close_now();

  // For operations other than kernels: ranges that they read and write. `what` begins the message.
  void expect_allocated(const void* p, uint64_t bytes, const std::string& what) const;
  void expect_written(const void* p, uint64_t bytes, const std::string& what) const;
  void mark_written(void* p, uint64_t bytes);
  // Overwrites a range with junk, never written from then on.
  void spoil(void* p, uint64_t bytes);
  // What is known about the bytes of one range becomes known about another.
  void copy_state(const void* from, void* to, uint64_t bytes);

  // For kernels. Thread `writer` of a launch; its threads' numbers begin with `first`.
  void kernel_read(const void* p, uint64_t bytes, uint32_t first, uint32_t writer);
  void kernel_write(void* p, uint64_t bytes, uint32_t first, uint32_t writer);
  // For a launch whose numbers begin at 1 again.
  void forget_writers();
  void kernel_atomic(void* p, uint64_t bytes, uint32_t first);

 private:
  struct Life {
    uint64_t begin = 0, end = 0;  // offsets
    int device = 0;
  };
  static constexpr uint32_t kCloseOneOf = 2048;
  static constexpr uint64_t kGuardPages =
      16;  // behind each allocation, plus the rest of its last page
  static constexpr uint64_t kChunk = 16384;      // cleaned per step
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
  int device_ = 0;                   // that operates now
  std::vector<uint32_t> page_life_;  // of each page: position in lives_ + 1
  std::vector<Life> lives_;
  std::vector<uint32_t> free_lives_;
  std::vector<bool> dirty_;     // chunks that were written
  uint8_t* written_ = nullptr;  // of each byte: whether it was
  uint32_t* writer_ = nullptr;  // of each byte: the last thread that wrote it, without atomics
  std::map<uint64_t, uint64_t> free_;  // pages: begin, count
  std::deque<std::pair<uint64_t, uint64_t>> quarantine_;
};

// The only instance.
DeviceMemory& device_memory();

}  // namespace voxdag::cuda_sim
