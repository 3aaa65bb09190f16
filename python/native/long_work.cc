#include "python/native/long_work.h"

#include <utility>

#include "python/native/path_text.h"

namespace voxdag::python {

void LatestProgress::begin_stage(std::string_view stage, uint64_t total, std::string_view unit) {
  const std::lock_guard lock(mutex_);
  state_ = {std::string(stage), std::string(unit), 0, total};
}

void LatestProgress::resume_at(uint64_t done) {
  const std::lock_guard lock(mutex_);
  state_.done = done;
}

void LatestProgress::advance(uint64_t count) {
  const std::lock_guard lock(mutex_);
  state_.done += count;
}

void LatestProgress::set_total(uint64_t total) {
  const std::lock_guard lock(mutex_);
  state_.total = total;
}

void LatestProgress::end_stage() {
  const std::lock_guard lock(mutex_);
  state_.done = state_.total = std::max(state_.done, state_.total);
}

void LatestProgress::warn(std::string_view message) {
  const std::lock_guard lock(mutex_);
  warnings_.emplace_back(message);
}

LatestProgress::State LatestProgress::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

std::vector<std::string> LatestProgress::take_warnings() {
  const std::lock_guard lock(mutex_);
  return std::exchange(warnings_, {});
}

void Messenger::pass_on(LatestProgress& progress) {
  if (PyErr_CheckSignals() != 0) throw nb::python_error();
  for (const std::string& message : progress.take_warnings())
    nb::module_::import_("voxdag._error").attr("warn")(message_text(message));
  const LatestProgress::State state = progress.state();
  if (callback_.is_none() || state == last_ || state.stage.empty()) return;
  last_ = state;
  callback_(state.stage, state.done, state.total, state.unit);
}

}  // namespace voxdag::python
