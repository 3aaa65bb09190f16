// The estimated cost of a cluster build, for `voxdag plan --cluster`.
#pragma once

#include <cstdint>
#include <string>

#include "scheduler/stages/plan/estimate.h"

namespace voxdag {

struct ClusterPlan {
  uint64_t tasks = 0;
  uint64_t memory_bytes = 0;   // recommended per task; with less memory, a task needs more passes
  EstimateRange cpu_hours;     // CPU hours of all tasks together
  EstimateRange task_s;        // CPU time per task, if all tasks were equal
  EstimateRange shared_bytes;  // peak space on the shared disk
  EstimateRange merge_s;       // CPU time of the merge, on the machine that submits
};

// Returns the default number of tasks: about two minutes of one CPU each.
uint64_t default_tasks(double expected_bricks, uint64_t subvolumes);

// Plans a build with `tasks` tasks, or with default_tasks() if `tasks` is 0. The plan has at most
// one task per subvolume.
ClusterPlan plan_cluster(const Estimate& estimate, uint64_t tasks);

// Returns the estimate and the plan as one JSON object.
std::string cluster_plan_json(const Estimate& estimate, const ClusterPlan& plan);

}  // namespace voxdag
