#include "server/jobs/live_job.h"

#include <algorithm>

#include "core/base/text/printable.h"
#include "core/fields/json_text.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxWarnings = 100;
constexpr size_t kMaxStages = 64;
// Limits for texts that the job's process sends, so that a job has a bounded size in memory and in
// answers.
constexpr size_t kMaxLabelBytes = 64;
constexpr size_t kMaxPlaceBytes = 1024;
constexpr size_t kMaxTextBytes = 4096;
constexpr size_t kMaxWarningBytes = 32 << 10;  // all warnings of a job
constexpr size_t kMaxNodes = 512;
constexpr size_t kMaxResultBytes = 64 << 10;

// Returns the text on one line, cut after `max_bytes`.
std::string bounded(const std::string& text, size_t max_bytes) {
  if (text.size() <= max_bytes) return printable_line(text);
  return printable_line(std::string_view(text).substr(0, max_bytes)) + "...";
}

Warning bounded(const Warning& warning) {
  return {bounded(warning.code, kMaxLabelBytes), bounded(warning.place, kMaxPlaceBytes),
          bounded(warning.message, kMaxTextBytes), warning.count};
}

size_t bytes_of(const std::vector<Warning>& warnings) {
  size_t bytes = 0;
  for (const Warning& warning : warnings)
    bytes += warning.code.size() + warning.place.size() + warning.message.size();
  return bytes;
}

// Keeps at most kMaxNodes nodes.
std::map<std::string, uint64_t> bounded(const std::map<std::string, uint64_t>& nodes) {
  std::map<std::string, uint64_t> kept;
  for (const auto& [name, count] : nodes) {
    if (kept.size() == kMaxNodes) break;
    kept[bounded(name, kMaxLabelBytes)] += count;
  }
  return kept;
}

ClusterTasks bounded(ClusterTasks tasks) {
  tasks.running = bounded(tasks.running);
  tasks.built_of_node = bounded(tasks.built_of_node);
  return tasks;
}

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
    if (stages_.size() == kMaxStages) {
      stages_.erase(stages_.begin());
      rates_.erase(rates_.begin());
    }
    rates_.emplace_back();
    stages_.push_back({.name = bounded(begun->stage, kMaxLabelBytes),
                       .unit = bounded(begun->unit, kMaxLabelBytes),
                       .total = begun->total,
                       .start_s = now});
  }
  if (const auto* resumed = std::get_if<StageResumed>(&message); resumed && !stages_.empty()) {
    stages_.back().done = stages_.back().resumed_at = resumed->done;
    rates_.back() = RateHistory(resumed->done);
  }
  if (const auto* advanced = std::get_if<StageAdvanced>(&message); advanced && !stages_.empty()) {
    StageProgress& stage = stages_.back();
    stage.wall_s = now - stage.start_s;
    stage.ended = false;
    stage.done = advanced->done;
    stage.total = advanced->total;
    rates_.back().add(stage.wall_s, stage.done);
  }
  if (std::holds_alternative<StageEnded>(message) && !stages_.empty()) {
    stages_.back().wall_s = now - stages_.back().start_s;
    stages_.back().ended = true;
    rates_.back().add(stages_.back().wall_s, stages_.back().done);
  }
  if (const auto* subvolumes = std::get_if<SubvolumeTotals>(&message)) subvolumes_ = *subvolumes;
  if (const auto* usage = std::get_if<Usage>(&message)) usage_ = *usage;
  if (const auto* tasks = std::get_if<ClusterTasks>(&message)) cluster_tasks_ = bounded(*tasks);
  if (const auto* reported = std::get_if<WarningReported>(&message);
      reported && warnings_.size() < kMaxWarnings && bytes_of(warnings_) < kMaxWarningBytes)
    warnings_.push_back(bounded(reported->warning));
  if (const auto* failure = std::get_if<Failure>(&message))
    failure_ = {bounded(failure->code, kMaxLabelBytes), bounded(failure->text, kMaxTextBytes)};
  if (const auto* result = std::get_if<Result>(&message);
      result && result->json.size() <= kMaxResultBytes)
    result_ = result->json;
}

std::string LiveJob::progress_json() const {
  std::lock_guard lock(mutex_);
  if (json_version_ != version_) {
    json_ = make_progress();
    json_version_ = version_;
  }
  return json_;
}

std::string LiveJob::rates_json() const {
  using nlohmann::ordered_json;
  std::lock_guard lock(mutex_);
  ordered_json stages = ordered_json::array();
  for (size_t i = 0; i < stages_.size(); ++i) {
    ordered_json points = ordered_json::array();
    for (const auto& [wall_s, rate] : rates_[i].points()) points.push_back({wall_s, rate});
    stages.push_back(
        {{"name", stages_[i].name}, {"unit", stages_[i].unit}, {"points", std::move(points)}});
  }
  return json_text(ordered_json{{"stages", std::move(stages)}});
}

std::string LiveJob::make_progress() const {
  using nlohmann::ordered_json;
  if (stages_.empty()) return "";
  const StageProgress& now = stages_.back();
  ordered_json stages = ordered_json::array();
  for (const StageProgress& stage : stages_)
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
      {"rate", rates_.back().rate()},
      {"eta_s", now.eta_s()},
      {"overall", make_overall()},
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

nlohmann::ordered_json LiveJob::make_overall() const {
  if (!result_.empty()) return {{"fraction", 1.0}, {"eta_s", 0.0}};
  const OverallProgress overall = overall_progress(stages_, shares_);
  fraction_ = std::max(fraction_, overall.fraction);
  nlohmann::ordered_json json = {{"fraction", fraction_}, {"eta_s", nullptr}};
  if (overall.eta_s) json["eta_s"] = *overall.eta_s;
  return json;
}

void LiveJob::stop() {
  std::lock_guard lock(mutex_);
  if (stop_requested_s_ == 0) stop_requested_s_ = wall_seconds();
}

}  // namespace voxdag::server
