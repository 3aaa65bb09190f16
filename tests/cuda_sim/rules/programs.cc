#include "tests/cuda_sim/rules/programs.h"

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>
#include <memory>

#include "core/backend/cuda/cuda_space.h"
#include "tests/cuda_sim/sim/device_memory.h"
#include "tests/cuda_sim/sim/faults.h"
#include "tests/cuda_sim/sim/shared_memory.h"

namespace voxdag::cuda {

extern unsigned char block_memory[];  // the shared memory of the running block

}  // namespace voxdag::cuda

namespace voxdag::cuda_sim {

extern uint32_t g_word_of_the_host;
uint32_t g_word_of_the_host = 0;

namespace {

constexpr uint32_t kWords = 1024, kBytes = kWords * sizeof(uint32_t);

// A stream, and 4 KiB of device memory (the words) allocated in this stream.
class Session {
 public:
  Session() {
    cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking);
    void* memory = nullptr;
    cudaMallocAsync(&memory, kBytes, stream_);
    words_ = static_cast<uint32_t*>(memory);
  }
  ~Session() {
    if (words_) release();
    wait();
    cudaStreamDestroy(stream_);
  }
  cudaStream_t stream() const { return stream_; }
  uint32_t* words() const { return words_; }
  void wait() const { cudaStreamSynchronize(stream_); }
  void release() {
    cudaFreeAsync(words_, stream_);
    words_ = nullptr;
  }
  // Every thread calls f(block, thread).
  template <class F>
  void launch(uint32_t blocks, uint32_t threads, size_t shared_bytes, F f) const {
    cudaLaunchConfig_t config = {};
    config.gridDim = dim3(blocks);
    config.blockDim = dim3(threads);
    config.dynamicSmemBytes = shared_bytes;
    config.stream = stream_;
    void (*kernel)(F) = [](F body) { body(blockIdx.x, threadIdx.x); };
    cudaLaunchKernelEx(&config, kernel, f);
  }
  void fill() const {
    launch(kWords / 64, 64, 0, [words = words_](uint32_t block, uint32_t thread) {
      words[block * 64 + thread] = thread;
    });
  }

 private:
  cudaStream_t stream_ = nullptr;
  uint32_t* words_ = nullptr;
};

uint32_t* shared_words() { return reinterpret_cast<uint32_t*>(cuda::block_memory); }

void writes_beyond_an_allocation() {
  const Session session;
  session.launch(1, 32, 0, [words = session.words()](uint32_t, uint32_t thread) {
    words[kWords - 31 + thread] = 0;
  });
  session.wait();
}

void reads_what_was_never_written() {
  const Session session;
  session.launch(1, 1, 0, [words = session.words()](uint32_t, uint32_t) { words[1] = words[0]; });
  session.wait();
}

void reads_what_was_released() {
  Session session;
  session.fill();
  uint32_t* words = session.words();
  session.release();
  session.launch(1, 1, 0, [words](uint32_t, uint32_t) { words[0] = words[1]; });
  session.wait();
}

void two_threads_write_a_word() {
  const Session session;
  session.launch(2, 32, 0,
                 [words = session.words()](uint32_t block, uint32_t) { words[block] = block; });
  session.wait();
}

void reads_what_another_thread_writes() {
  const Session session;
  session.fill();
  session.launch(1, 64, 0, [words = session.words()](uint32_t, uint32_t thread) {
    words[thread] = words[thread ^ 1] + 1;
  });
  session.wait();
}

void has_no_barrier() {
  const Session session;
  session.launch(1, 64, kBytes, [words = session.words()](uint32_t, uint32_t thread) {
    shared_words()[thread] = thread;
    words[thread] = shared_words()[thread ^ 1];
  });
  session.wait();
}

void two_threads_write_a_shared_word() {
  const Session session;
  session.launch(1, 64, kBytes,
                 [](uint32_t, uint32_t thread) { shared_words()[thread / 2] = thread; });
  session.wait();
}

void uses_more_shared_memory_than_it_asked_for() {
  const Session session;
  session.launch(1, 33, 128, [](uint32_t, uint32_t thread) { shared_words()[thread] = thread; });
  session.wait();
}

void some_threads_miss_a_barrier() {
  const Session session;
  session.launch(1, 64, 0, [](uint32_t, uint32_t thread) {
    if (thread > 0) __syncthreads();
  });
  session.wait();
}

void a_kernel_touches_the_host() {
  const Session session;
  const auto mine = std::make_unique<uint32_t>(1);
  session.launch(1, 1, 0, [words = session.words(), host = mine.get()](uint32_t, uint32_t) {
    words[0] = *host;
  });
  session.wait();
}

void the_host_touches_the_device() {
  const Session session;
  session.fill();
  session.wait();
  session.words()[0] = 1;
}

void an_uploads_source_changes() {
  const Session session;
  uint32_t value = 1;
  cudaMemcpyAsync(session.words(), &value, sizeof(value), cudaMemcpyHostToDevice, session.stream());
  value = 2;
  session.wait();
}

void pinned_memory_is_released_early() {
  const Session session;
  session.fill();
  void* pinned = nullptr;
  cudaMallocHost(&pinned, kBytes);
  cudaMemcpyAsync(pinned, session.words(), kBytes, cudaMemcpyDeviceToHost, session.stream());
  cudaFreeHost(pinned);
}

void another_stream_does_not_wait() {
  const Session one, other;
  other.launch(1, 1, 0, [words = one.words()](uint32_t, uint32_t) { words[0] = 1; });
  other.wait();
}

void a_copy_goes_another_way() {
  const Session session;
  uint32_t value = 1;
  cudaMemcpyAsync(session.words(), &value, sizeof(value), cudaMemcpyDeviceToDevice,
                  session.stream());
}

void a_copy_is_too_long() {
  const Session session;
  const std::vector<char> source(kBytes + 1);
  cudaMemcpyAsync(session.words(), source.data(), kBytes + 1, cudaMemcpyHostToDevice,
                  session.stream());
}

void memory_is_released_twice() {
  Session session;
  uint32_t* words = session.words();
  session.release();
  cudaFreeAsync(words, session.stream());
}

void a_stream_is_used_after_its_end() {
  const Session session;
  cudaStreamDestroy(session.stream());
  session.fill();
}

// Sorts 64 keys of 8 bytes at the start of the session's words. The second buffer follows the keys.
void sort(const Session& session, void* storage, size_t bytes) {
  auto* keys = reinterpret_cast<uint64_t*>(session.words());
  cub::DoubleBuffer<uint64_t> buffers(keys, keys + 64);
  cub::DeviceRadixSort::SortKeys(storage, bytes, buffers, 64, 0, 64, session.stream());
}

void cub_has_too_little_storage() {
  const Session session;
  session.fill();
  sort(session, session.words() + 512, 512);
  session.wait();
}

void cubs_storage_is_in_use() {
  const Session session;
  session.fill();
  sort(session, session.words(), 2048);
  session.wait();
}

// The storage, which begins at word 130, overlaps the sort's second buffer, which begins at word
// 128.
void cubs_storage_is_written() {
  const Session session;
  session.fill();
  sort(session, session.words() + 130, 2048);
  session.wait();
}

void selects_in_place() {
  const Session session;
  session.fill();
  auto* flags = reinterpret_cast<uint8_t*>(session.words());
  size_t bytes = 2048;
  cub::DeviceSelect::Flagged(session.words() + 256, bytes, session.words(), flags, session.words(),
                             session.words() + 1000, 64, session.stream());
  session.wait();
}

void touches_a_word_off_its_alignment() {
  const Session session;
  session.fill();
  session.launch(1, 1, 0, [words = session.words()](uint32_t, uint32_t) {
    *reinterpret_cast<uint64_t*>(words + 1) = 1;
  });
  session.wait();
}

void writes_far_beyond_an_allocation() {
  const Session session, neighbor;
  session.launch(1, 1, 0, [words = session.words()](uint32_t, uint32_t) { words[5000] = 1; });
  session.wait();
}

void a_kernel_writes_a_global_of_the_host() {
  const Session session;
  session.launch(1, 1, 0, [](uint32_t, uint32_t) { g_word_of_the_host = 1; });
  session.wait();
}

}  // namespace

std::vector<BrokenProgram> broken_programs() {
#define VOXDAG_PROGRAM(name) #name, name
  return {
      {VOXDAG_PROGRAM(writes_beyond_an_allocation), "a kernel writes 4 bytes"},
      {VOXDAG_PROGRAM(reads_what_was_never_written), "a kernel reads, never written"},
      {VOXDAG_PROGRAM(reads_what_was_released), "a kernel reads 4 bytes"},
      {VOXDAG_PROGRAM(two_threads_write_a_word), "a race: two threads of a launch write"},
      {VOXDAG_PROGRAM(reads_what_another_thread_writes), "a race: a thread reads"},
      {VOXDAG_PROGRAM(has_no_barrier), "reads shared memory that its block never wrote"},
      {VOXDAG_PROGRAM(two_threads_write_a_shared_word), "a race in shared memory"},
      {VOXDAG_PROGRAM(uses_more_shared_memory_than_it_asked_for), "more shared memory"},
      {VOXDAG_PROGRAM(some_threads_miss_a_barrier), "divergent barrier: 63 threads wait, 1 have"},
      {VOXDAG_PROGRAM(a_kernel_touches_the_host), "a kernel touches memory of the host"},
      {VOXDAG_PROGRAM(the_host_touches_the_device), "the host touches device memory"},
      {VOXDAG_PROGRAM(an_uploads_source_changes), "the source of an upload changed"},
      {VOXDAG_PROGRAM(pinned_memory_is_released_early), "pinned memory is released that a queued"},
      {VOXDAG_PROGRAM(another_stream_does_not_wait), "a kernel writes 4 bytes"},
      {VOXDAG_PROGRAM(a_copy_goes_another_way), "a copy goes another way"},
      {VOXDAG_PROGRAM(a_copy_is_too_long), "the target of a copy or memset is not within"},
      {VOXDAG_PROGRAM(memory_is_released_twice), "memory is released that is not allocated"},
      {VOXDAG_PROGRAM(a_stream_is_used_after_its_end), "a stream that does not exist"},
      {VOXDAG_PROGRAM(cub_has_too_little_storage), "less storage than it asked for"},
      {VOXDAG_PROGRAM(cubs_storage_is_in_use), "CUB's storage overlaps its other arguments"},
      {VOXDAG_PROGRAM(cubs_storage_is_written), "CUB's storage overlaps its other arguments"},
      {VOXDAG_PROGRAM(selects_in_place), "CUB writes what it reads"},
      {VOXDAG_PROGRAM(touches_a_word_off_its_alignment), "a misaligned access"},
      {VOXDAG_PROGRAM(writes_far_beyond_an_allocation), "a kernel writes 4 bytes"},
      {VOXDAG_PROGRAM(a_kernel_writes_a_global_of_the_host), "a kernel touches memory of the host"},
  };
#undef VOXDAG_PROGRAM
}

std::vector<uint32_t> exchange_with_neighbors(uint32_t blocks, uint32_t threads) {
  const Session session;
  session.launch(blocks, threads, threads * sizeof(uint32_t),
                 [words = session.words(), threads](uint32_t block, uint32_t thread) {
                   shared_words()[thread] = thread;
                   __syncthreads();
                   words[block * threads + thread] = shared_words()[(thread + 1) % threads];
                 });
  std::vector<uint32_t> read(size_t{blocks} * threads);
  cudaMemcpyAsync(read.data(), session.words(), read.size() * sizeof(uint32_t),
                  cudaMemcpyDeviceToHost, session.stream());
  session.wait();
  return read;
}

DownloadedWord download_word(uint32_t value) {
  const Session session;
  session.launch(1, 1, 0,
                 [words = session.words(), value](uint32_t, uint32_t) { words[0] = value; });
  DownloadedWord word;
  uint32_t mailbox = 0;
  cudaMemcpyAsync(&mailbox, session.words(), sizeof(mailbox), cudaMemcpyDeviceToHost,
                  session.stream());
  word.before = mailbox;
  session.wait();
  word.after = mailbox;
  return word;
}

uint64_t upload_then_change(uint64_t value) {
  cuda::CudaDevice device(0);
  MemoryBudget budget(uint64_t{1} << 30);
  const CancelToken cancel;
  cuda::CudaSpace space = device.open({6, {}, 64}, budget, cancel);
  cuda::CudaSpace::Array<uint64_t> there(space, 1);
  uint64_t here = value;
  space.upload(&here, there.data(), 1);
  here = ~value;
  uint64_t back = 0;
  space.download(there.data(), &back, 1);
  return back;
}

const volatile uint32_t* words_of_the_device() {
  static const Session session;  // static, so that the memory is still allocated after the return
  session.fill();
  session.wait();
  device_memory().close_now();
  return session.words();
}

uint64_t forget_an_allocation() {
  Session session;
  void* memory = nullptr;
  cudaMallocAsync(&memory, 100, session.stream());
  session.release();
  session.wait();
  const uint64_t left = bytes_in_use();
  cudaFreeAsync(memory, session.stream());
  return left;
}

}  // namespace voxdag::cuda_sim
