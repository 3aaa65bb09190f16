// Makes durable what was merged, now and then, on a thread beside the merge, and sees to it that
// the files which that names stay.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/base/clock.h"
#include "merge/checkpoint/merge_state.h"

namespace voxdag {

// Bytes of an input's segment that are of no use any more.
struct MergedBytes {
  uint32_t segment = 0;
  uint64_t offset = 0;
  uint64_t bytes = 0;
};

class MergeCheckpointer {
 public:
  MergeCheckpointer(Checkpoint* checkpoint, double interval_s)
      : checkpoint_(checkpoint), interval_s_(interval_s) {}
  ~MergeCheckpointer() {
    if (save_.valid()) save_.wait();
    for (const auto& path : named_) path->keep();
  }
  MergeCheckpointer(const MergeCheckpointer&) = delete;
  MergeCheckpointer& operator=(const MergeCheckpointer&) = delete;

  // Throws Error{kCorrupt} for one that is damaged.
  std::optional<MergeState> load() {
    if (!checkpoint_) return std::nullopt;
    const auto bytes = checkpoint_->load();
    if (!bytes) return std::nullopt;
    return decode_state(*bytes);
  }
  // The state that was loaded names this file.
  void add_named(std::shared_ptr<ScratchPath> path) { named_.push_back(std::move(path)); }
  std::span<const std::shared_ptr<ScratchPath>> named() const { return named_; }
  void forget() {
    if (checkpoint_) checkpoint_->forget();
    named_.clear();
  }

  // Enough was done since the last state, and that is saved. Throws what went wrong with it.
  bool due() {
    if (!checkpoint_ || process_cpu_seconds() - saved_s_ < interval_s_) return false;
    if (save_.valid() && save_.wait_for(std::chrono::seconds(0)) == std::future_status::timeout)
      return false;
    settle();
    return true;
  }
  // Saves a state beside the merge. `named`: the files of the scratch folder that it names, which
  // `sync` makes durable; those that only the state before named are removed. `merged` is released
  // once the state is durable.
  void save_soon(uint32_t level, MergeState state, std::vector<std::shared_ptr<ScratchPath>> named,
                 std::function<void()> sync, std::vector<MergedBytes> merged) {
    settle();
    saved_s_ = process_cpu_seconds();
    // Should saving fail, nobody knows which of the two states is the durable one: both are kept.
    const auto before = static_cast<std::ptrdiff_t>(named_.size());
    named_.insert(named_.end(), named.begin(), named.end());
    // Where the system has no thread left, settle() does it.
    save_ = std::async([this, level, before, state = std::move(state), sync = std::move(sync),
                        merged = std::move(merged)]() mutable {
      sync();
      checkpoint_->save(level, encode_state(std::move(state)));
      named_.erase(named_.begin(), named_.begin() + before);
      for (const auto& [segment, offset, bytes] : merged)
        if (!ends_) checkpoint_->release(segment, offset, bytes);
    });
    // Tests want a state after every level.
    if (interval_s_ == 0) settle();
  }
  // Waits for the state that is being saved.
  void settle() {
    if (save_.valid()) save_.get();
  }
  // The same when all is merged: what is not released yet need not be any more.
  void finish() {
    ends_ = true;
    settle();
  }

 private:
  Checkpoint* const checkpoint_;
  const double interval_s_;
  double saved_s_ = process_cpu_seconds();
  std::vector<std::shared_ptr<ScratchPath>> named_;  // that of the thread that saves, while it does
  std::atomic<bool> ends_ = false;
  std::future<void> save_;
};

}  // namespace voxdag
