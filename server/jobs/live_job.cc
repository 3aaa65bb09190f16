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

bool LiveJob::take(const Report& report) {
  std::lock_guard lock(mutex_);
  ++version_;
  const double now = wall_seconds();
  switch (report.kind) {
    case Report::Kind::kStage:
      if (stages_.size() == kMaxStages) stages_.erase(stages_.begin());
      stages_.push_back({report.text, report.unit, 0, report.total, now, 0, false});
      return true;
    case Report::Kind::kAdvance:
    case Report::Kind::kEnd:
      if (stages_.empty()) return false;
      stages_.back().wall_s = now - stages_.back().start_s;
      stages_.back().ended = report.kind == Report::Kind::kEnd;
      if (stages_.back().ended) return true;
      stages_.back().done = report.done;
      stages_.back().total = report.total;
      return false;
    case Report::Kind::kBuilt:
      built_ = report;
      return false;
    case Report::Kind::kWarning:
      if (warnings_.size() < kMaxWarnings) warnings_.push_back(report.text);
      return true;
    case Report::Kind::kError:
      failure_ = report;
      return false;
    case Report::Kind::kResult:
      result_ = report.text;
      return false;
  }
  return false;
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
      {"subvolumes", {{"built", built_.done}, {"total", built_.total}}},
      {"voxels", built_.voxels},
      {"nodes", built_.nodes},
      {"bytes", built_.bytes},
      {"memory_bytes", built_.memory_bytes},
      {"disk_bytes", built_.disk_bytes},
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

std::optional<Report> LiveJob::failure() const {
  std::lock_guard lock(mutex_);
  return failure_;
}

std::string LiveJob::result() const {
  std::lock_guard lock(mutex_);
  return result_;
}

void LiveJob::stop() {
  std::lock_guard lock(mutex_);
  if (stop_asked_s_ == 0) stop_asked_s_ = wall_seconds();
}

double LiveJob::stop_asked_s() const {
  std::lock_guard lock(mutex_);
  return stop_asked_s_;
}

}  // namespace voxdag::server
