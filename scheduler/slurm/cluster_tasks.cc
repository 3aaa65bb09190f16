// The part of ClusterBuild that looks after its tasks: those that failed, waited in vain or took
// too long.
#include <memory>
#include <utility>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "scheduler/slurm/cluster_build.h"
#include "scheduler/stages/build/split_subvolume.h"

namespace voxdag {

// Learns from Slurm which tasks wait and run. A batch that has neither a task nor, after a while in
// which the shared disk may show it, a record has failed.
void ClusterBuild::look_after_tasks() {
  const auto active = slurm_.active(state_.task_name());
  if (!active) {
    if (is_answering_) context_.progress.warn("Slurm does not answer (squeue): waiting for it");
    is_answering_ = false;
    return;
  }
  is_answering_ = true;
  std::set<uint32_t> listed;
  std::vector<SlurmTask> given_up;
  for (const SlurmTask& task : *active) {
    OpenBatch* const batch = state_.find(task.batch());
    if (task.is_given_up()) {
      given_up.push_back(task);
      continue;
    }
    listed.insert(task.batch());
    note_reason(task);
    missing_since_.erase(task.batch());
    // Of two attempts, the one that runs is shown.
    if (!batch || (batch->task && batch->task->name() != task.name() && task.state != "RUNNING"))
      continue;
    is_changed_ = is_changed_ || batch->task != task;
    batch->task = task;
  }
  cancel_given_up(given_up, listed);
  std::vector<uint32_t> again, to_split;
  for (OpenBatch& batch : state_.open) {
    if (listed.contains(batch.number)) continue;
    if (!batch.task) {
      again.push_back(batch.number);
      continue;
    }
    const auto [since, is_new] = missing_since_.try_emplace(batch.number, wall_seconds());
    const bool is_over =
        says_that_it_ended(batch) || wall_seconds() - since->second >= options_.grace_s;
    if (is_over && !end_attempt(batch, again, to_split)) break;
  }
  for (const uint32_t batch : to_split)
    for (const uint32_t part : split(batch)) again.push_back(part);
  submit(again);
  report_tasks();
}

// Tasks that Slurm will never start have failed, once it has canceled them; those that it has not
// are `listed`. A node that fails at once may take them again: the grace lies between the attempts.
void ClusterBuild::cancel_given_up(const std::vector<SlurmTask>& tasks,
                                   std::set<uint32_t>& listed) {
  std::vector<std::string> names;
  for (const SlurmTask& task : tasks) names.push_back(task.name());
  const bool are_canceled = slurm_.cancel_tasks(names);
  for (const SlurmTask& task : tasks) {
    OpenBatch* const batch = state_.find(task.batch());
    if (!are_canceled) listed.insert(task.batch());
    if (!batch || !are_canceled) continue;
    if (!batch->task) batch->task = task;
    if (batch->task->name() == task.name())
      own_reasons_[batch->number] = {"Slurm could not start it (" + task.reason + ")", false};
  }
}

// Says once why tasks wait, if it is not just for their turn.
void ClusterBuild::note_reason(const SlurmTask& task) {
  if (task.state == "PENDING" && !waits_for_its_turn(task.reason) &&
      noted_reasons_.insert(task.reason).second)
    context_.progress.warn("task " + task.name() + " waits: " + task.reason);
}

void ClusterBuild::report_tasks() const {
  ClusterTasks tasks;
  tasks.built = state_.totals.batches;
  tasks.batches = tasks.built + state_.open.size();
  tasks.failed_attempts = state_.totals.attempts;
  tasks.built_of_node = state_.totals.batches_of_node;
  for (const OpenBatch& batch : state_.open) {
    if (batch.task && !batch.task->node.empty())
      ++tasks.running[batch.task->node];
    else
      ++tasks.waiting;
  }
  context_.progress.set_cluster_tasks(tasks);
}

bool ClusterBuild::says_that_it_ended(const OpenBatch& batch) const {
  const auto own = own_reasons_.find(batch.number);
  return own != own_reasons_.end() && own->second.has_ended;
}

bool ClusterBuild::end_attempt(OpenBatch& batch, std::vector<uint32_t>& again,
                               std::vector<uint32_t>& to_split) {
  const auto end = slurm_.end_of(batch.task->name());
  if (!end) return false;
  const auto own = own_reasons_.find(batch.number);
  if (end->is_active() && !says_that_it_ended(batch)) return true;  // squeue did not list it.
  AttemptEnd attempt{batch.task->name(), end->node.empty() ? batch.task->node : end->node,
                     end->text()};
  if (own != own_reasons_.end()) {
    attempt.reason += ": " + own->second.text;
    own_reasons_.erase(own);
  }
  ++state_.totals.attempts;
  batch.task.reset();
  missing_since_.erase(batch.number);
  is_changed_ = true;
  const bool is_out_of_time = end->state == "TIMEOUT" || end->state == "DEADLINE";
  const bool is_split = is_out_of_time && can_be_split(batch);
  const bool was_of_earlier_run = inherited_.erase(batch.number) > 0;
  if (!is_split && !was_of_earlier_run && end->state != "PREEMPTED")
    batch.failures.push_back(attempt);
  const std::string what = "batch " + std::to_string(batch.number) + ", task " + attempt.task +
                           (attempt.node.empty() ? "" : " on " + attempt.node) + ": " +
                           attempt.reason;
  if (batch.failures.size() > options_.max_retries)
    give_up(batch.number, ErrorCode::kLimit,
            what + "; it has failed " + std::to_string(batch.failures.size()) +
                " times: see the logs in " + folder_.path());
  context_.progress.warn(
      what + (is_split ? "; it is split and submitted again" : "; it is submitted again"));
  (is_split ? to_split : again).push_back(batch.number);
  return true;
}

bool ClusterBuild::can_be_split(const OpenBatch& batch) const {
  return batch.subvolumes.size() > 1 ||
         batch.subvolumes[0].cube.edge_voxels(state_.shape.grid_levels) > kSmallestEdge;
}

// The next run cuts the batch's subvolumes again, from the scene: its file may be what is wrong.
void ClusterBuild::give_up(uint32_t batch, ErrorCode code, const std::string& why) {
  std::erase_if(state_.open, [&](const OpenBatch& b) { return b.number == batch; });
  save_state();
  files_.remove(folder_.batch_path(batch));
  throw Error(code, why);
}

// Two batches instead of one that takes too long; returns their numbers.
std::vector<uint32_t> ClusterBuild::split(uint32_t number) {
  try {
    return split_batch(number);
  } catch (const Error& error) {
    if (!error.is_corruption()) throw;
    give_up(number, error.code(), error.message());
  }
}

std::vector<uint32_t> ClusterBuild::split_batch(uint32_t number) {
  auto file = std::make_unique<BatchFile>(files_, folder_.batch_path(number));
  Batch like = file->batch();
  MemoryBudget budget(spec_.run.memory_bytes / 4);
  MemoryStore triangles(files_, work_.spill_path(), like.wide, budget);
  std::vector<BinId> bins = file->copy_to(triangles, context_.cancel);
  file.reset();  // it is removed below
  std::vector<BatchSubvolume> parts = std::exchange(like.subvolumes, {});
  if (parts.size() == 1) {
    const StoredSubvolume whole = subvolumes_.at(parts[0].id);
    const auto octants = split_subvolume({whole, bins[0]}, state_.shape.grid_levels, triangles,
                                         jobs_, context_.progress, context_.cancel);
    parts.clear();
    bins.clear();
    for (const auto& [octant, bin] : octants) {
      subvolumes_[octant.id] = octant;
      parts.push_back({octant.id, octant.cube, octant.weight, triangles.count(bin)});
      bins.push_back(bin);
    }
  }
  CutBatches cut = make_batches(like, parts, 2, state_.next_batch);
  std::vector<uint32_t> numbers;
  for (const OpenBatch& open : cut.open) numbers.push_back(open.number);
  open_batches(std::move(cut), bins, triangles, 1, [] {});
  context_.progress.set_total(jobs_.leaves().size());
  std::erase_if(state_.open, [&](const OpenBatch& b) { return b.number == number; });
  save_state();
  files_.remove(folder_.batch_path(number));
  return numbers;
}

}  // namespace voxdag
