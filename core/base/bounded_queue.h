// Two halves of a piece of work on two threads: one makes items, the other takes them. They go
// through a few slots, which are used again and again, as is the memory that items hold.
#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>

namespace voxdag {

template <class Item, size_t kSlots>
class BoundedQueue {
 public:
  // The writer's: the next slot to fill, once one is free, with what was in it before. Null if the
  // reader gave up.
  Item* free_slot() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return gave_up_ || pushed_ - popped_ < kSlots; });
    return gave_up_ ? nullptr : &slots_[pushed_ % kSlots];
  }
  // Hands the slot over.
  void push() {
    change([&] { ++pushed_; });
  }
  // Nothing more comes.
  void end() {
    change([&] { ended_ = true; });
  }

  // The reader's: the next item, once there is one. Null after the last.
  Item* front() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return ended_ || popped_ < pushed_; });
    return popped_ < pushed_ ? &slots_[popped_ % kSlots] : nullptr;
  }
  // The item is no longer needed.
  void pop() {
    change([&] { ++popped_; });
  }
  void give_up() {
    change([&] { gave_up_ = true; });
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

  std::array<Item, kSlots> slots_;
  std::mutex mutex_;
  std::condition_variable changed_;
  size_t pushed_ = 0, popped_ = 0;
  bool ended_ = false, gave_up_ = false;
};

// Calls make(pass) on this thread, which calls pass(fill) for every item, which calls fill(item),
// the item as it was left when it was last used; and take(item) for each, in order, on another
// thread, or on this one if there may be one only or the system has no other. After an exception of
// take() the next pass() does not return. Throws what take() threw, or else what make() did.
template <class Item, size_t kSlots, class Make, class Take>
void run_producer_consumer(unsigned threads, Make make, Take take) {
  struct GaveUp {};
  BoundedQueue<Item, kSlots> ring;
  std::exception_ptr of_make, of_take;
  std::thread taker;
  const auto take_all = [&] {
    try {
      for (; const Item* item = ring.front(); ring.pop()) take(*item);
    } catch (...) {
      of_take = std::current_exception();
      ring.give_up();
    }
  };
  try {
    if (threads > 1) taker = std::thread(take_all);
  } catch (const std::system_error&) {  // as if one were asked for
  }
  if (!taker.joinable()) {
    Item item;
    make([&](auto fill) {
      fill(item);
      take(item);
    });
    return;
  }
  try {
    make([&](auto fill) {
      Item* const slot = ring.free_slot();
      if (!slot) throw GaveUp{};
      fill(*slot);
      ring.push();
    });
  } catch (const GaveUp&) {
  } catch (...) {
    of_make = std::current_exception();
  }
  ring.end();
  taker.join();
  if (of_take) std::rethrow_exception(of_take);
  if (of_make) std::rethrow_exception(of_make);
}

}  // namespace voxdag
