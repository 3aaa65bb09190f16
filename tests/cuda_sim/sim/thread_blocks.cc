#include "tests/cuda_sim/sim/thread_blocks.h"

#include <setjmp.h>
#include <sys/mman.h>
#include <ucontext.h>

#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "tests/cuda_sim/sim/device_memory.h"
#include "tests/cuda_sim/sim/schedule.h"
#include "tests/cuda_sim/sim/shared_memory.h"
#include "tests/cuda_sim/sim/violation.h"

namespace voxdag::cuda_sim {

thread_local RunningThread g_running;

namespace {

constexpr size_t kStackBytes = size_t{64} << 10;
constexpr uint32_t kMaxThreads = 1024;

char* g_stacks = nullptr;
uint32_t g_next_number = 1;

struct Fiber {
  ucontext_t context;  // for the first switch to the fiber; later switches are cheaper longjmps
  jmp_buf place;
  bool started = false;
  uint32_t thread = 0;
};

// Runs one block, then the next. A fiber runs threads one after the other until a thread waits at a
// barrier. Only then does another fiber run the remaining threads. So a kernel without barriers
// needs one fiber.
class Block {
 public:
  void run(const KernelLaunch& launch, uint32_t block) {
    launch_ = &launch;
    g_running.block = block;
    RandomOrder order(launch.threads);
    order_ = &order;
    started_ = ended_ = 0;
    waiting_.clear();
    begin_block(launch.shared_bytes);
    while (started_ < launch.threads) resume(idle_fiber());
    while (!waiting_.empty()) pass_barrier();
  }

  void wait() {
    waiting_.push_back(current_);
    switch_back();
  }

  // The body of each fiber, which never ends.
  void work() {
    for (;;) {
      while (started_ < launch_->threads) {
        ++started_;
        current_->thread = order_->next();
        identify();
        launch_->run_thread(launch_->arguments);
        ++ended_;
      }
      idle_.push_back(current_);
      switch_back();
    }
  }

 private:
  void pass_barrier() {
    if (ended_ > 0)
      violation("a divergent barrier: " + std::to_string(waiting_.size()) + " threads wait, " +
                std::to_string(ended_) + " have ended");
    next_interval();
    const std::vector<Fiber*> ready = std::exchange(waiting_, {});
    RandomOrder order(static_cast<uint32_t>(ready.size()));
    for (size_t i = 0; i < ready.size(); ++i) resume(ready[order.next()]);
  }

  // Sets the thread's numbers in g_running. Not inlined, because a fiber may resume on another host
  // thread, where g_running is a different variable.
  [[gnu::noinline]] void identify() {
    g_running.thread = current_->thread;
    g_running.number = g_running.first + g_running.block * launch_->threads + current_->thread;
  }

  void resume(Fiber* fiber) {
    current_ = fiber;
    identify();
    g_running.running = true;
    if (_setjmp(host_) == 0) {
      if (std::exchange(fiber->started, true)) _longjmp(fiber->place, 1);
      setcontext(&fiber->context);
    }
    g_running.running = false;
  }
  void switch_back() {
    if (_setjmp(current_->place) == 0) _longjmp(host_, 1);
  }

  Fiber* idle_fiber() {
    if (idle_.empty()) idle_.push_back(make_fiber());
    Fiber* fiber = idle_.back();
    idle_.pop_back();
    return fiber;
  }
  Fiber* make_fiber();

  const KernelLaunch* launch_ = nullptr;
  RandomOrder* order_ = nullptr;
  uint32_t started_ = 0, ended_ = 0;
  jmp_buf host_;
  Fiber* current_ = nullptr;
  size_t fiber_count_ = 0;
  std::vector<Fiber*> idle_, waiting_;
};

Block& the_block() {
  static Block& block = *new Block;
  return block;
}

void fiber_main() { the_block().work(); }

Fiber* Block::make_fiber() {
  if (!g_stacks)
    g_stacks = static_cast<char*>(mmap(nullptr, kMaxThreads * kStackBytes, PROT_READ | PROT_WRITE,
                                       MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0));
  Fiber* fiber = new Fiber;  // never deleted
  getcontext(&fiber->context);
  fiber->context.uc_stack.ss_sp = g_stacks + kStackBytes * fiber_count_++;
  fiber->context.uc_stack.ss_size = kStackBytes;
  fiber->context.uc_link = nullptr;
  makecontext(&fiber->context, fiber_main, 0);
  return fiber;
}

}  // namespace

bool on_fiber_stack(const void* p) {
  const char* at = static_cast<const char*>(p);
  return at >= g_stacks && at < g_stacks + kMaxThreads * kStackBytes;
}

void block_barrier() { the_block().wait(); }

void run_kernel(const KernelLaunch& launch) {
  g_running.launch = &launch;
  if (uint64_t{g_next_number} + uint64_t{launch.blocks} * launch.threads > UINT32_MAX) {
    device_memory().forget_writers();
    g_next_number = 1;
  }
  g_running.first = g_next_number;
  g_next_number += launch.blocks * launch.threads;
  RandomOrder order(launch.blocks);
  for (uint32_t i = 0; i < launch.blocks; ++i) the_block().run(launch, order.next());
}

}  // namespace voxdag::cuda_sim
