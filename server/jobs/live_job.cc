#include "server/jobs/live_job.h"

#include <nlohmann/json.hpp>

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxWarnings = 100;
constexpr size_t kMaxStages = 64;

}  // namespace

LiveJob::LiveJob(std::string id, uint64_t memory_bytes)
    : id_(std::move(id)), memory_bytes_(memory_bytes), start_s_(wall_seconds()) {}

void LiveJob::apply(const Message& message) {
  std::lock_guard lock(mutex_);
  ++version_;
  const double now = wall_seconds();
  if (const auto* begun = std::get_if<StageBegun>(&message)) {
    if (stages_.size() == kMaxStages) stages_.erase(stages_.begin());
    stages_.push_back({begun->stage, begun->unit, 0, begun->total, now, 0, false});
  } else if (const auto* advanced = std::get_if<StageAdvanced>(&message)) {
    if (stages_.empty()) return;
    Stage& stage = stages_.back();
    stage.wall_s = now - stage.start_s;
    stage.ended = false;
    stage.done = advanced->done;
    stage.total = advanced->total;
  } else if (std::holds_alternative<StageEnded>(message)) {
    if (stages_.empty()) return;
    stages_.back().wall_s = now - stages_.back().start_s;
    stages_.back().ended = true;
  } else if (const auto* subvolumes = std::get_if<SubvolumeTotals>(&message)) {
    subvolumes_ = *subvolumes;
  } else if (const auto* usage = std::get_if<Usage>(&message)) {
    usage_ = *usage;
  } else if (const auto* warning = std::get_if<Warning>(&message)) {
    if (warnings_.size() < kMaxWarnings) warnings_.push_back(warning->text);
  } else if (const auto* failure = std::get_if<Failure>(&message)) {
    failure_ = *failure;
  } else if (const auto* result = std::get_if<Result>(&message)) {
    result_ = result->json;
  }
}

std::string LiveJob::progress_json() const {
  std::lock_guard lock(mutex_);
  if (json_version_ != version_) {
    json_ = make_progress();
    json_version_ = version_;
  }
  return json_;
}

std::string LiveJob::make_progress() const {
  using nlohmann::ordered_json;
  if (stages_.empty()) return "";
  const Stage& now = stages_.back();
  const double rate = now.wall_s > 0 ? static_cast<double>(now.done) / now.wall_s : 0;
  const double left = now.total > now.done ? static_cast<double>(now.total - now.done) : 0;
  ordered_json stages = ordered_json::array();
  for (const Stage& stage : stages_)
    stages.push_back({{"name", stage.name},
                      {"unit", stage.unit},
                      {"done", stage.done},
                      {"total", stage.total},
                      {"wall_s", stage.wall_s},
                      {"ended", stage.ended}});
  return ordered_json{
      {"stage", now.name},
      {"unit", now.unit},
      {"done", now.done},
      {"total", now.total},
      {"rate", rate},
      {"eta_s", rate > 0 && !now.ended ? left / rate : 0.0},
      {"elapsed_s", wall_seconds() - start_s_},
      {"stages", std::move(stages)},
      {"subvolumes", {{"built", subvolumes_.built}, {"total", subvolumes_.total}}},
      {"voxels", subvolumes_.voxels},
      {"nodes", subvolumes_.nodes},
      {"bytes", subvolumes_.bytes},
      {"memory_bytes", usage_.memory_bytes},
      {"disk_bytes", usage_.disk_bytes},
  }
      .dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

uint64_t LiveJob::version() const {
  std::lock_guard lock(mutex_);
  return version_;
}

std::vector<std::string> LiveJob::warnings() const {
  std::lock_guard lock(mutex_);
  return warnings_;
}

std::optional<Failure> LiveJob::failure() const {
  std::lock_guard lock(mutex_);
  return failure_;
}

std::string LiveJob::result() const {
  std::lock_guard lock(mutex_);
  return result_;
}

void LiveJob::stop() {
  std::lock_guard lock(mutex_);
  if (stop_requested_s_ == 0) stop_requested_s_ = wall_seconds();
}

double LiveJob::stop_requested_s() const {
  std::lock_guard lock(mutex_);
  return stop_requested_s_;
}

}  // namespace voxdag::server
