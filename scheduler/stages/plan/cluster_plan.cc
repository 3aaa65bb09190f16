#include "scheduler/stages/plan/cluster_plan.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/fields/json_text.h"
#include "scheduler/stages/plan/estimate_range.h"
#include "scheduler/triangles/chunk.h"

namespace voxdag {
namespace {

// CPU time per expected brick. Measured times range from 3 ns (the scene repeats itself) to 150 ns
// (no repetition).
constexpr double kSecondsPerBrick = 30e-9;
constexpr double kTaskSeconds = 120;  // wanted CPU time per task
constexpr uint64_t kMaxDefaultTasks = 1000;
// The merge's share of a build's CPU time, as measured (docs/performance.md).
constexpr double kMergeShare = 0.2;
// CPU time of the tasks relative to the same work in one process. A task also reads its batch and
// merges its artifacts; the final merge reads and merges the tasks' artifacts again.
constexpr double kTaskOverhead = 1.15;
// Triangle records in all batches per triangle of the scene: a triangle at a border between
// subvolumes is in several subvolumes.
constexpr double kTaskCopies = 1.2;
// Recommended memory per task. It is enough for the largest planned subvolumes on two threads.
constexpr uint64_t kTaskMemory = uint64_t{2} << 30;

}  // namespace

uint64_t default_tasks(double expected_bricks, uint64_t subvolumes) {
  const uint64_t most = std::clamp<uint64_t>(subvolumes, 1, kMaxDefaultTasks);
  const double wanted = std::ceil(expected_bricks * kSecondsPerBrick / kTaskSeconds);
  return static_cast<uint64_t>(std::clamp(wanted, 1.0, static_cast<double>(most)));
}

ClusterPlan plan_cluster(const Estimate& estimate, uint64_t tasks) {
  ClusterPlan plan;
  plan.tasks =
      std::min(tasks ? tasks : default_tasks(estimate.expected_bricks, estimate.subvolumes),
               std::max<uint64_t>(estimate.subvolumes, 1));
  plan.memory_bytes = kTaskMemory;
  const EstimateRange tasks_s = kTaskOverhead * (1 - kMergeShare) * estimate.cpu_s;
  plan.cpu_hours = 1.0 / 3600 * tasks_s;
  plan.task_s = 1 / static_cast<double>(plan.tasks) * tasks_s;
  plan.merge_s = kMergeShare * estimate.cpu_s;
  const double batches = kTaskCopies * static_cast<double>(estimate.triangles) *
                         static_cast<double>(triangle_record_bytes(false));
  plan.shared_bytes = estimate.disk_bytes + exactly(batches);
  return plan;
}

std::string cluster_plan_json(const Estimate& estimate, const ClusterPlan& plan) {
  auto json = parse_json<nlohmann::ordered_json>(estimate_json(estimate));
  json["cluster"] = {{"tasks", plan.tasks},
                     {"task_memory_bytes", plan.memory_bytes},
                     {"cpu_hours", range_json(plan.cpu_hours)},
                     {"task_s", range_json(plan.task_s)},
                     {"merge_s", range_json(plan.merge_s)},
                     {"shared_bytes", count_json(plan.shared_bytes)}};
  return exact_json_text(json, 2);
}

}  // namespace voxdag
