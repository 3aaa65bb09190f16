// Passes items from one thread to another through a few slots, which are used again and again, as
// is the memory that items hold.
#pragma once

#include <array>
#include <condition_variable>
#include <cstddef>
#include <mutex>

namespace voxdag {

template <class Item, size_t kSlots>
class SlotRing {
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

}  // namespace voxdag
