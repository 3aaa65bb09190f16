#include "server/jobs/live_job.h"

#include <algorithm>

#include "server/base/json_text.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxWarnings = 100;
constexpr size_t kMaxStages = 64;

nlohmann::ordered_json cluster_json(const ClusterTasks& tasks) {
  using nlohmann::ordered_json;
  std::map<std::string, uint64_t> names = tasks.running;
  names.insert(tasks.built_of_node.begin(), tasks.built_of_node.end());
  const auto count = [](const std::map<std::string, uint64_t>& counts, const std::string& name) {
    const auto found = counts.find(name);
    return found == counts.end() ? 0 : found->second;
  };
  ordered_json nodes = ordered_json::array();
  for (const auto& [name, any] : names)
    nodes.push_back({{"name", name},
                     {"running", count(tasks.running, name)},
                     {"built", count(tasks.built_of_node, name)}});
  return {{"batches", tasks.batches},
          {"built", tasks.built},
          {"waiting", tasks.waiting},
          {"failed_attempts", tasks.failed_attempts},
          {"nodes", std::move(nodes)}};
}

}  // namespace

void LiveJob::apply(const Message& message) {
  std::lock_guard lock(mutex_);
  ++version_;
  const double now = wall_seconds();
  if (const auto* begun = std::get_if<StageBegun>(&message)) {
    if (stages_.size() == kMaxStages) stages_.erase(stages_.begin());
    stages_.push_back(
        {.name = begun->stage, .unit = begun->unit, .total = begun->total, .start_s = now});
  }
  if (const auto* resumed = std::get_if<StageResumed>(&message); resumed && !stages_.empty())
    stages_.back().done = stages_.back().resumed_at = resumed->done;
  if (const auto* advanced = std::get_if<StageAdvanced>(&message); advanced && !stages_.empty()) {
    Stage& stage = stages_.back();
    stage.wall_s = now - stage.start_s;
    stage.ended = false;
    stage.done = advanced->done;
    stage.total = advanced->total;
  }
  if (std::holds_alternative<StageEnded>(message) && !stages_.empty()) {
    stages_.back().wall_s = now - stages_.back().start_s;
    stages_.back().ended = true;
  }
  if (const auto* subvolumes = std::get_if<SubvolumeTotals>(&message)) subvolumes_ = *subvolumes;
  if (const auto* usage = std::get_if<Usage>(&message)) usage_ = *usage;
  if (const auto* tasks = std::get_if<ClusterTasks>(&message)) cluster_tasks_ = *tasks;
  if (const auto* reported = std::get_if<WarningReported>(&message);
      reported && warnings_.size() < kMaxWarnings)
    warnings_.push_back(reported->warning);
  if (const auto* failure = std::get_if<Failure>(&message)) failure_ = *failure;
  if (const auto* result = std::get_if<Result>(&message)) result_ = result->json;
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
  const auto done_here = static_cast<double>(now.done - std::min(now.resumed_at, now.done));
  const double rate = now.wall_s > 0 ? done_here / now.wall_s : 0;
  const double left = now.total > now.done ? static_cast<double>(now.total - now.done) : 0;
  ordered_json stages = ordered_json::array();
  for (const Stage& stage : stages_)
    stages.push_back({{"name", stage.name},
                      {"unit", stage.unit},
                      {"done", stage.done},
                      {"total", stage.total},
                      {"resumed_at", stage.resumed_at},
                      {"wall_s", stage.wall_s},
                      {"ended", stage.ended}});
  ordered_json progress = {
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
  };
  if (cluster_tasks_) progress["cluster"] = cluster_json(*cluster_tasks_);
  return json_text(progress);
}

void LiveJob::stop() {
  std::lock_guard lock(mutex_);
  if (stop_requested_s_ == 0) stop_requested_s_ = wall_seconds();
}

}  // namespace voxdag::server
