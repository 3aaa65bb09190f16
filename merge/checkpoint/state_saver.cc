#include "merge/checkpoint/state_saver.h"

#include <chrono>
#include <utility>

#include "core/base/background.h"

namespace voxdag {

StateSaver::~StateSaver() {
  if (save_.valid()) save_.wait();
  for (const auto& path : named_) path->retain();
}

std::optional<MergeState> StateSaver::load() const {
  if (!checkpoint_) return std::nullopt;
  const auto bytes = checkpoint_->load();
  if (!bytes) return std::nullopt;
  return decode_state(*bytes);
}

void StateSaver::forget() {
  if (checkpoint_) checkpoint_->forget();
  named_.clear();
}

bool StateSaver::is_due() {
  if (!checkpoint_ || process_cpu_seconds() - saved_s_ < interval_s_) return false;
  if (save_.valid() && save_.wait_for(std::chrono::seconds(0)) == std::future_status::timeout)
    return false;
  wait();
  return true;
}

void StateSaver::save(uint32_t level, MergeState state,
                      std::vector<std::shared_ptr<ScratchPath>> named, std::function<void()> sync,
                      std::vector<SegmentRange> merged) {
  wait();
  saved_s_ = process_cpu_seconds();
  // If saving fails, the durable state is either the previous or the new one, so the files of both
  // states are kept.
  const auto before = static_cast<std::ptrdiff_t>(named_.size());
  named_.insert(named_.end(), named.begin(), named.end());
  save_ = run_in_background([this, level, before, state = std::move(state), sync = std::move(sync),
                             merged = std::move(merged)]() mutable {
    sync();
    checkpoint_->save(level, encode_state(std::move(state)));
    named_.erase(named_.begin(), named_.begin() + before);
    for (const SegmentRange& range : merged)
      if (!finishing_) checkpoint_->release(range);
  });
  // Tests set the interval to 0 to save a state after every level. During a save, is_due() would
  // return false, so this call waits.
  if (interval_s_ == 0) wait();
}

void StateSaver::wait() {
  if (save_.valid()) save_.get();
}

void StateSaver::finish() {
  finishing_ = true;
  wait();
}

}  // namespace voxdag
