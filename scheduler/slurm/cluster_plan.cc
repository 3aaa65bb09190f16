#include "scheduler/slurm/cluster_plan.h"

#include <nlohmann/json.hpp>

#include "scheduler/slurm/batches.h"
#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

// The merge's share of a build's CPU time, as measured (docs/performance.md).
constexpr double kMergeShare = 0.2;
// A task also reads its batch and merges its artifacts. The final merge repeats both.
constexpr double kTaskOverhead = 1.15;
// Records per triangle: triangles near borders are in several subvolumes.
constexpr double kTaskCopies = 1.2;
// Enough for the largest planned subvolumes on two threads.
constexpr uint64_t kTaskMemory = uint64_t{2} << 30;

EstimateRange scaled(double factor, const EstimateRange& range) {
  return {factor * range.low, factor * range.likely, factor * range.high};
}

nlohmann::ordered_json to_json(const EstimateRange& r) {
  return {{"low", r.low}, {"likely", r.likely}, {"high", r.high}};
}

}  // namespace

ClusterPlan plan_cluster(const Estimate& estimate, uint64_t tasks) {
  ClusterPlan plan;
  plan.tasks =
      std::min(tasks ? tasks : default_tasks(estimate.expected_bricks, estimate.subvolumes),
               std::max<uint64_t>(estimate.subvolumes, 1));
  plan.memory_bytes = kTaskMemory;
  const EstimateRange tasks_s = scaled(kTaskOverhead * (1 - kMergeShare), estimate.cpu_s);
  plan.cpu_hours = scaled(1.0 / 3600, tasks_s);
  plan.task_s = scaled(1 / static_cast<double>(plan.tasks), tasks_s);
  plan.merge_s = scaled(kMergeShare, estimate.cpu_s);
  const double batches = kTaskCopies * static_cast<double>(estimate.triangles) *
                         static_cast<double>(triangle_record_bytes(false));
  plan.shared_bytes = {estimate.disk_bytes.low + batches, estimate.disk_bytes.likely + batches,
                       estimate.disk_bytes.high + batches};
  return plan;
}

std::string cluster_plan_json(const Estimate& estimate, const ClusterPlan& plan) {
  auto json = nlohmann::ordered_json::parse(estimate_json(estimate));
  json["cluster"] = {{"tasks", plan.tasks},
                     {"task_memory_bytes", plan.memory_bytes},
                     {"cpu_hours", to_json(plan.cpu_hours)},
                     {"task_s", to_json(plan.task_s)},
                     {"merge_s", to_json(plan.merge_s)},
                     {"shared_bytes", to_json(plan.shared_bytes)}};
  return json.dump(2);
}

}  // namespace voxdag
