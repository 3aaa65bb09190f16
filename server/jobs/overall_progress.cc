#include "server/jobs/overall_progress.h"

#include <algorithm>

namespace voxdag::server {
namespace {

// An attempt that has run for less time gives no useful estimate of the remaining time.
constexpr double kMinSpentS = 1;

// Returns `done` as a fraction of the stage's total, 0 to 1.
double part_of(const StageProgress& stage, uint64_t done) {
  if (stage.total == 0) return 0;
  return std::min(1.0, static_cast<double>(done) / static_cast<double>(stage.total));
}

double completed_part(const StageProgress& stage) {
  return stage.ended ? 1 : part_of(stage, stage.done);
}

// The part of the stage that this attempt did. Earlier attempts did the rest.
double part_of_this_attempt(const StageProgress& stage) {
  return std::max(0.0, completed_part(stage) - part_of(stage, stage.resumed_at));
}

const StageProgress* find_last(std::span<const StageProgress> stages, const std::string& name) {
  const auto found = std::find_if(stages.rbegin(), stages.rend(),
                                  [&](const StageProgress& stage) { return stage.name == name; });
  return found == stages.rend() ? nullptr : &*found;
}

}  // namespace

double StageProgress::average_rate() const {
  return wall_s > 0 ? static_cast<double>(done - std::min(resumed_at, done)) / wall_s : 0;
}

double StageProgress::eta_s() const {
  const double left = total > done ? static_cast<double>(total - done) : 0;
  return average_rate() > 0 && !ended ? left / average_rate() : 0;
}

std::vector<StageShare> long_stages(const GeometryOptions& options) {
  const bool is_solid = options.solid != SolidName::kNone;
  const bool is_enclosed = options.solid == SolidName::kEnclosed;
  std::vector<StageShare> stages = {{"ingest", 10}};
  if (is_solid && !is_enclosed) stages.push_back({"rows", 10});
  stages.push_back({"build", 60});
  if (is_enclosed) stages.push_back({"enclose", 20});
  stages.push_back({"merge", 25});
  if (options.order == OrderName::kFirstParent) stages.push_back({"reorder", 25});
  if (options.attributes.any()) stages.push_back({"color", 140});
  stages.push_back({"write", 5});
  return stages;
}

OverallProgress overall_progress(std::span<const StageProgress> begun,
                                 std::span<const StageShare> shares) {
  // `shares_done` is the sum of the shares of all completed work, and `shares_here` is the part of
  // this sum that this attempt completed. Stages before the current long stage are complete. A
  // stage that did not begin was not needed.
  double shares_done = 0, shares_here = 0, shares_passed = 0, all_shares = 0, spent_s = 0;
  const StageProgress* now = nullptr;  // the last long stage that has begun
  for (const auto& [name, share] : shares) {
    if (const StageProgress* const stage = find_last(begun, name)) {
      now = stage;
      shares_done = all_shares + share * completed_part(*stage);
      shares_here += share * part_of_this_attempt(*stage);
      shares_passed = all_shares + share;
    }
    all_shares += share;
  }
  if (!now) return {};
  for (const StageProgress& stage : begun) spent_s += stage.wall_s;
  OverallProgress progress{shares_done / all_shares, std::nullopt};
  const bool is_stage_known = now->ended || now->eta_s() > 0;
  if (is_stage_known && shares_here > 0 && spent_s > kMinSpentS)
    progress.eta_s = now->eta_s() + (all_shares - shares_passed) * spent_s / shares_here;
  return progress;
}

}  // namespace voxdag::server
