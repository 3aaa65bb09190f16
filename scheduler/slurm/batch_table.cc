#include "scheduler/slurm/batch_table.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "core/io/random_id.h"
#include "scheduler/slurm/files/batch_file.h"
#include "scheduler/stages/build/split_subvolume.h"
#include "scheduler/stages/plan/cluster_plan.h"
#include "scheduler/state/job_progress.h"
#include "scheduler/triangles/chunk.h"
#include "scheduler/triangles/memory_store.h"

namespace voxdag {

void BatchTable::resume(const std::string& scene_digest, const DagShape& shape) {
  cluster_.files().make_directories(cluster_.folder.path());
  const auto earlier = read_cluster_state(cluster_.files(), cluster_.job.work.path());
  const bool has_cluster = cluster_.job.spec.run.cluster.has_value();
  if (earlier && earlier->scene_digest == scene_digest && earlier->shape == shape &&
      earlier->rule == cluster_.job.spec.geometry.rule() &&
      earlier->solid == solid_rule_of(cluster_.job.spec.geometry) &&
      (earlier->program == cluster_.options.program_version || !has_cluster)) {
    state_ = *earlier;
  } else {
    if (earlier) {
      if (!cluster_.options.is_merge_job) cluster_.slurm.cancel(earlier->merge_job_name());
      cluster_.slurm.cancel(earlier->task_name());
    }
    start_new(scene_digest, shape);
  }
  earlier_requests_ = state_.totals.requests;
  // Segment names contain batch numbers. New batches get numbers above the numbers in the segments
  // of all recorded subvolumes, so their segments have new names even if cluster.json was lost.
  for (const StoredSubvolume& subvolume : cluster_.job.store->leaves()) {
    rows_[subvolume.id] = subvolume;
    if (const uint32_t segment = subvolume.artifact.segment; segment >= kFirstClusterSegment)
      state_.next_batch = std::max(state_.next_batch, segment - kFirstClusterSegment + 1);
  }
  // Drops an open batch if its batch file is missing, or if one of its subvolumes is already built
  // or is missing in the job store. A subvolume is already built if the earlier process accepted
  // the record and was killed before it saved this table.
  std::erase_if(state_.open, [&](const OpenBatch& batch) { return !is_valid(batch); });
  save();
}

void BatchTable::start_new(const std::string& scene_digest, const DagShape& shape) {
  state_.build = random_id();
  state_.program = cluster_.options.program_version;
  state_.scene_digest = scene_digest;
  state_.shape = shape;
  state_.rule = cluster_.job.spec.geometry.rule();
  state_.solid = solid_rule_of(cluster_.job.spec.geometry);
}

bool BatchTable::is_valid(const OpenBatch& batch) const {
  return cluster_.files().exists(cluster_.folder.batch_path(batch.number)) &&
         std::ranges::all_of(batch.subvolumes, [&](const ExpectedSubvolume& expected) {
           const auto found = rows_.find(expected.id);
           return found != rows_.end() && found->second.cube == expected.cube &&
                  found->second.state == SubvolumeState::kPlanned;
         });
}

std::set<SubvolumeId> BatchTable::subvolumes() const {
  std::set<SubvolumeId> ids;
  for (const OpenBatch& batch : state_.open)
    for (const ExpectedSubvolume& subvolume : batch.subvolumes) ids.insert(subvolume.id);
  return ids;
}

void BatchTable::add(std::span<const StoredSubvolume> subvolumes, std::span<const BinId> bins,
                     const TriangleStore& triangles) {
  const RunOptions& run = cluster_.job.spec.run;
  std::vector<size_t> order(subvolumes.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::sort(order, {}, [&](size_t i) { return morton_place(subvolumes[i].cube); });
  std::vector<BatchSubvolume> ordered;
  std::vector<BinId> ordered_bins;
  double weight = 0;
  for (const size_t i : order) {
    const StoredSubvolume& subvolume = subvolumes[i];
    rows_[subvolume.id] = subvolume;
    ordered.push_back(item_of(subvolume, triangles.count(bins[i])));
    ordered_bins.push_back(bins[i]);
    weight += subvolume.weight;
  }
  Batch batch;
  batch.program = state_.program;
  batch.build = state_.build;
  batch.shape = state_.shape;
  batch.rule = state_.rule;
  batch.wide = triangles.record_bytes() == triangle_record_bytes(true);
  batch.solid = state_.solid;
  // The CPU backend is the only backend that fills solids.
  batch.backend = cluster_.job.rows ? BackendName::kCpu : run.backend;
  batch.method = run.method;
  if (run.subvolume_edge) batch.longest_edge = static_cast<int64_t>(run.subvolume_edge);
  CutBatches cut =
      make_batches(batch, ordered, tasks_for(weight, ordered.size()), state_.next_batch);
  Progress& progress = cluster_.progress();
  progress.begin_stage("batches", cut.batches.size(), "batches");
  open_batches(std::move(cut), ordered_bins, triangles, run.threads, [&] { progress.advance(1); });
  progress.end_stage();
  save();
}

// Returns the subvolume as an item of a batch, with its rows if the build is a solid.
BatchSubvolume BatchTable::item_of(const StoredSubvolume& subvolume, uint64_t triangles) const {
  BatchSubvolume item{subvolume.id, subvolume.cube, subvolume.weight, triangles, {}, {}};
  if (!cluster_.job.rows) return item;
  const SubvolumeRows rows = cluster_.job.rows->find(subvolume.cube);
  item.unit = rows.unit;
  item.views.assign(std::begin(rows.views), std::end(rows.views));
  return item;
}

// Returns the number of tasks for subvolumes of this total weight: the subvolumes' share of
// ClusterOptions::tasks, or default_tasks() if the option is not set.
uint64_t BatchTable::tasks_for(double weight, uint64_t subvolumes) const {
  if (cluster_.options.tasks == 0) return default_tasks(weight, subvolumes);
  double all = 0;
  for (const StoredSubvolume& leaf : cluster_.job.store->leaves()) all += leaf.weight;
  const double share = all > 0 ? weight / all : 1;
  return std::max<uint64_t>(
      static_cast<uint64_t>(std::llround(static_cast<double>(cluster_.options.tasks) * share)), 1);
}

// Writes the files of the batches `cut` and adds these batches to the table as open. Calls
// after_each() after each file. The caller saves the table.
void BatchTable::open_batches(CutBatches cut, std::span<const BinId> bins,
                              const TriangleStore& triangles, unsigned threads,
                              const std::function<void()>& after_each) {
  if (state_.next_batch + cut.batches.size() >= kMaxBatches)
    throw Error(ErrorCode::kLimit, "the build needs batch numbers up to " +
                                       std::to_string(state_.next_batch + cut.batches.size() - 1) +
                                       ": expected less than " + std::to_string(kMaxBatches) +
                                       "; start over with " + option_text("restart"));
  SolidRows* const rows = cluster_.job.rows.get();
  parallel_for(threads, cut.batches.size(), [&](unsigned, size_t i) {
    const Batch& batch = cut.batches[i];
    write_batch(
        cluster_.files(), cluster_.folder.batch_path(batch.number), batch,
        [&](size_t item) { return triangles.open(bins[cut.first_items[i] + item]); },
        rows ? &rows->file() : nullptr, cluster_.job.context.cancel);
    after_each();
  });
  state_.next_batch += static_cast<uint32_t>(cut.batches.size());
  for (OpenBatch& open : cut.open) state_.open.push_back(std::move(open));
}

bool BatchTable::can_be_split(const OpenBatch& batch) const {
  return batch.subvolumes.size() > 1 ||
         batch.subvolumes[0].cube.edge_voxels(state_.shape.grid_levels) > kSmallestEdge;
}

std::vector<uint32_t> BatchTable::split(uint32_t batch) {
  try {
    return split_file(batch);
  } catch (const Error& error) {
    if (!error.is_corruption()) throw;
    give_up(batch, error.code(), error.message());
  }
}

std::vector<uint32_t> BatchTable::split_file(uint32_t number) {
  BuildJob& job = cluster_.job;
  const std::string path = cluster_.folder.batch_path(number);
  auto file = std::make_unique<BatchFile>(cluster_.files(), path);
  Batch like = file->batch();
  MemoryBudget budget(job.spec.run.memory_bytes / 4);
  MemoryStore triangles(cluster_.files(), job.work.spill_path(), like.wide, budget);
  std::vector<BinId> bins = file->copy_to(triangles, nullptr, job.context.cancel);
  file.reset();  // close the file, which is removed below
  std::vector<BatchSubvolume> parts = std::exchange(like.subvolumes, {});
  if (job.rows)
    for (BatchSubvolume& part : parts) part = item_of(rows_.at(part.id), part.triangles);
  if (parts.size() == 1) {
    std::optional<SplitSolid> solid;
    if (job.rows) solid.emplace(SplitSolid{*job.rows, job.budget});
    const auto octants = split_subvolume({rows_.at(parts[0].id), bins[0]}, state_.shape.grid_levels,
                                         triangles, *job.store, job.context.progress,
                                         job.context.cancel, solid ? &*solid : nullptr);
    parts.clear();
    bins.clear();
    for (const auto& [octant, bin] : octants) {
      rows_[octant.id] = octant;
      parts.push_back(item_of(octant, triangles.count(bin)));
      bins.push_back(bin);
    }
  }
  CutBatches cut = make_batches(like, parts, 2, state_.next_batch);
  std::vector<uint32_t> numbers;
  for (const OpenBatch& open : cut.open) numbers.push_back(open.number);
  open_batches(std::move(cut), bins, triangles, 1, [] {});
  job.context.progress.set_total(job.store->leaves().size());
  close(number);
  save();
  cluster_.files().remove(path);
  return numbers;
}

void BatchTable::record_built(const CompletionRecord& record) {
  std::vector<StoredSubvolume> rows;
  for (const BuiltSubvolume& built : record.subvolumes) {
    StoredSubvolume& row = rows_.at(built.id);
    row.state = SubvolumeState::kBuilt;
    row.summary = built.summary;
    row.artifact = built.summary.empty() ? ArtifactRef{} : record.artifact;
    rows.push_back(row);
  }
  cluster_.job.store->record_built(rows);
  add_to_totals(record);
  close(record.batch);
  is_changed_ = true;
  Progress& progress = cluster_.progress();
  for (const StoredSubvolume& row : rows) {
    SubvolumeStatus status = status_of(row, state_.shape.grid_levels);
    status.built = true;
    // The subvolumes of a batch share one artifact, which is counted once.
    status.bytes = &row == &rows.front() ? record.artifact.bytes : 0;
    progress.subvolume_built(status);
  }
  progress.advance(rows.size());
}

void BatchTable::add_to_totals(const CompletionRecord& record) {
  ClusterTotals& totals = state_.totals;
  const double to_start_s = record.started_s - state_.submitted_s;
  if (totals.batches == 0 || to_start_s < totals.first_task_s) totals.first_task_s = to_start_s;
  ++totals.batches;
  ++totals.batches_of_node[record.node];
  totals.split += record.split;
  totals.rows_before += record.rows_before;
  totals.rows_after += record.rows_after;
  totals.cpu_s += record.cpu_s;
  totals.longest_s = std::max(totals.longest_s, record.wall_s);
}

void BatchTable::record_submission(double now_s) {
  if (state_.submitted_s == 0) state_.submitted_s = now_s;
}

void BatchTable::close(uint32_t batch) {
  std::erase_if(state_.open, [&](const OpenBatch& open) { return open.number == batch; });
}

void BatchTable::forget_failures() {
  for (OpenBatch& batch : state_.open) {
    batch.failures.clear();
    batch.error.reset();
  }
}

void BatchTable::give_up(uint32_t batch, ErrorCode code, const std::string& why) {
  close(batch);
  save();
  cluster_.files().remove(cluster_.folder.batch_path(batch));
  throw Error(code, why);
}

void BatchTable::save() {
  state_.totals.requests = earlier_requests_ + cluster_.slurm.requests();
  write_file_atomically(cluster_.files(), cluster_.folder.state_path(), encode_state(state_));
  is_changed_ = false;
}

void BatchTable::try_save() {
  try {
    save();
    is_saved_ = true;
  } catch (const Error& error) {
    if (is_saved_)
      cluster_.progress().warn(
          "the state of the tasks cannot be written, so a later run may repeat batches: " +
          error.message());
    is_saved_ = false;
  }
}

void BatchTable::show_tasks() const {
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
  cluster_.progress().set_cluster_tasks(tasks);
}

}  // namespace voxdag
