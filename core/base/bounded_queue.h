// A bounded queue of one producer and one consumer, and a loop that runs both on two threads. Items
// go through a fixed ring of slots, so the memory that an item owns is reused.
#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>

namespace voxdag {

template <class Item, size_t kCapacity>
class BoundedQueue {
 public:
  // For the producer: waits for a free slot, which still has its earlier contents. Null once stop()
  // was called.
  Item* free_slot() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return stopped_ || pushed_ - popped_ < kCapacity; });
    return stopped_ ? nullptr : &slots_[pushed_ % kCapacity];
  }
  // Appends the slot of free_slot() to the queue.
  void push() {
    change([&] { ++pushed_; });
  }
  // The producer has pushed its last item.
  void end() {
    change([&] { ended_ = true; });
  }

  // For the consumer: waits for the next item. Null after the last.
  Item* front() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return ended_ || popped_ < pushed_; });
    return popped_ < pushed_ ? &slots_[popped_ % kCapacity] : nullptr;
  }
  // Frees the slot of the item of front().
  void pop() {
    change([&] { ++popped_; });
  }
  // The consumer takes no more items.
  void stop() {
    change([&] { stopped_ = true; });
  }

 private:
  template <class Change>
  void change(Change apply) {
    {
      std::lock_guard lock(mutex_);
      apply();
    }
    changed_.notify_all();
  }

  std::array<Item, kCapacity> slots_;
  std::mutex mutex_;
  std::condition_variable changed_;
  size_t pushed_ = 0, popped_ = 0;
  bool ended_ = false, stopped_ = false;
};

// Runs produce(pass) on this thread and consume(item) on another, or both on this one if `threads`
// is 1 or the system has no other thread. For every item produce() calls pass(fill), which calls
// fill(item) with an item in the state of its last use; consume() gets the items in that order.
// Once consume() has thrown, the next pass() does not return. Throws what consume() threw, or else
// what produce() threw.
template <class Item, size_t kCapacity, class Produce, class Consume>
void run_producer_consumer(unsigned threads, Produce produce, Consume consume) {
  struct Stopped {};
  BoundedQueue<Item, kCapacity> queue;
  std::exception_ptr produce_failure, consume_failure;
  std::thread consumer;
  const auto consume_all = [&] {
    try {
      for (; const Item* item = queue.front(); queue.pop()) consume(*item);
    } catch (...) {
      consume_failure = std::current_exception();
      queue.stop();
    }
  };
  try {
    if (threads > 1) consumer = std::thread(consume_all);
  } catch (const std::system_error&) {
    // One thread does both.
  }
  if (!consumer.joinable()) {
    Item item;
    produce([&](auto fill) {
      fill(item);
      consume(item);
    });
    return;
  }
  try {
    produce([&](auto fill) {
      Item* const slot = queue.free_slot();
      if (!slot) throw Stopped{};
      fill(*slot);
      queue.push();
    });
  } catch (const Stopped&) {
    // consume_failure says why.
  } catch (...) {
    produce_failure = std::current_exception();
  }
  queue.end();
  consumer.join();
  if (consume_failure) std::rethrow_exception(consume_failure);
  if (produce_failure) std::rethrow_exception(produce_failure);
}

}  // namespace voxdag
