#include "tests/cuda_sim/sim/shared_memory.h"

#include <cstring>
#include <string>

#include "tests/cuda_sim/sim/violation.h"

namespace voxdag::cuda {

// The array that kernels declare as their dynamic shared memory.
extern unsigned char block_memory[];
alignas(16) unsigned char block_memory[cuda_sim::kMaxSharedBytes];

}  // namespace voxdag::cuda

namespace voxdag::cuda_sim {
namespace {

constexpr unsigned char kJunk = 0xd5;
constexpr uint32_t kNobody = UINT32_MAX, kSeveral = UINT32_MAX - 1;

// The threads that read, wrote or atomically updated a word since the last barrier.
struct Word {
  uint64_t interval = 0;
  uint32_t reader = kNobody, writer = kNobody, updater = kNobody;
  uint64_t block = 0;
  uint8_t written = 0;  // a bit for each byte that the block has written
};

Word g_words[kMaxSharedBytes / 4];
uint64_t g_interval = 0, g_block = 0;
size_t g_bytes = 0;

bool is_other(uint32_t toucher, uint32_t thread) { return toucher != kNobody && toucher != thread; }

void add(uint32_t& toucher, uint32_t thread) {
  toucher = is_other(toucher, thread) ? kSeveral : thread;
}

void touch(Word& word, uint8_t bytes, Access access, uint32_t thread) {
  if (word.interval != g_interval) {
    word.reader = word.writer = word.updater = kNobody;
    word.interval = g_interval;
  }
  if (word.block != g_block) {
    word.written = 0;
    word.block = g_block;
  }
  if (access != Access::kWrite && (word.written & bytes) != bytes)
    violation("a thread reads shared memory that its block never wrote");
  if (is_other(word.writer, thread) || (access != Access::kRead && is_other(word.reader, thread)) ||
      (access != Access::kAtomic && is_other(word.updater, thread)))
    violation("a race in shared memory: thread " + std::to_string(thread) +
              (access == Access::kRead    ? " reads"
               : access == Access::kWrite ? " writes"
                                          : " updates") +
              " a word that another thread touched since the last barrier");
  switch (access) {
    case Access::kRead:
      return add(word.reader, thread);
    case Access::kWrite:
      word.written |= bytes;
      return add(word.writer, thread);
    case Access::kAtomic:
      return add(word.updater, thread);
  }
}

}  // namespace

void begin_block(size_t shared_bytes) {
  ++g_block;
  ++g_interval;
  g_bytes = shared_bytes;
  std::memset(cuda::block_memory, kJunk, shared_bytes);
}

void next_interval() { ++g_interval; }

bool in_shared_memory(const void* p) {
  const unsigned char* at = static_cast<const unsigned char*>(p);
  return at >= cuda::block_memory && at < cuda::block_memory + kMaxSharedBytes;
}

void shared_access(const void* p, size_t bytes, Access access, uint32_t thread) {
  const size_t at = static_cast<size_t>(static_cast<const unsigned char*>(p) - cuda::block_memory);
  if (at + bytes > g_bytes)
    violation("a thread touches more shared memory than its launch asked for");
  for (size_t word = at / 4; word <= (at + bytes - 1) / 4; ++word) {
    const size_t from = word * 4 < at ? at - word * 4 : 0;
    const size_t to = at + bytes < word * 4 + 4 ? at + bytes - word * 4 : 4;
    touch(g_words[word], static_cast<uint8_t>((1u << to) - (1u << from)), access, thread);
  }
}

}  // namespace voxdag::cuda_sim
