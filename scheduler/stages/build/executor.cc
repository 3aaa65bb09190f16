#include "scheduler/stages/build/executor.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "core/base/text.h"
#include "core/format/artifact/artifact_writer.h"
#include "scheduler/solid/full_cubes.h"
#include "scheduler/solid/part_rows.h"
#include "scheduler/solid/row_sums.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/stages/build/split_subvolume.h"
#include "scheduler/stages/partition/partition.h"
#include "scheduler/state/job_progress.h"

namespace voxdag {
namespace {

bool lighter(const QueuedSubvolume& a, const QueuedSubvolume& b) {
  return a.subvolume.weight < b.subvolume.weight;
}

// The remaining subvolumes of all workers, heaviest first. The queue ends when it is empty and no
// worker is building a subvolume that could still be split.
class Queue {
 public:
  explicit Queue(std::vector<QueuedSubvolume> heap) : heap_(std::move(heap)) {
    std::make_heap(heap_.begin(), heap_.end(), lighter);
  }
  // Returns the next subvolume to build; nullopt at the end.
  std::optional<QueuedSubvolume> pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return failure_ || !heap_.empty() || in_flight_ == 0; });
    if (failure_ || heap_.empty()) return std::nullopt;
    std::pop_heap(heap_.begin(), heap_.end(), lighter);
    const QueuedSubvolume next = heap_.back();
    heap_.pop_back();
    ++in_flight_;
    return next;
  }
  // Called when the work on a subvolume from pop() has ended. Queues `parts`: the octants that
  // replace the subvolume if it was split, nothing if it was built.
  void done(const std::vector<QueuedSubvolume>& parts) {
    std::lock_guard lock(mutex_);
    --in_flight_;
    for (const QueuedSubvolume& part : parts) {
      heap_.push_back(part);
      std::push_heap(heap_.begin(), heap_.end(), lighter);
    }
    changed_.notify_all();
  }
  // Runs a worker's code; an exception stops all workers.
  template <class Code>
  void guard(const Code& code) {
    try {
      code();
    } catch (...) {
      std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
      changed_.notify_all();
    }
  }
  // Call it after all workers have stopped.
  bool has_failed() const { return failure_ != nullptr; }
  // Call it after all workers have stopped.
  void rethrow_failure() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<QueuedSubvolume> heap_;
  unsigned in_flight_ = 0;
  std::exception_ptr failure_;
};

class Worker {
 public:
  Worker(const ExecutorOptions& options, uint32_t number, TriangleStore& triangles, JobStore& jobs,
         MemoryBudget& budget, uint64_t share_bytes, const BuildContext& context)
      : options_(options),
        triangles_(triangles),
        jobs_(jobs),
        files_(context.files),
        cancel_(context.cancel),
        progress_(context.progress),
        share_(share_bytes, &budget),
        commits_(std::make_unique<CommitQueue>(
            jobs,
            std::make_unique<SegmentWriter>(context.files, options.segment_folder,
                                            options.first_segment_id + number, budget),
            triangles, options.checkpoint_interval_s)),
        segment_(commits_->segment()),
        backend_(options.open_backend()) {}

  // Builds one subvolume and returns {}, or splits it and returns the parts, at most eight, that
  // replace it.
  std::vector<QueuedSubvolume> build(const QueuedSubvolume& queued) {
    cancel_.check();
    const Cube& cube = queued.subvolume.cube;
    if (options_.rows != nullptr && options_.rows->find(cube).unit != SolidUnit::kShell)
      return build_without_shell(queued);
    const int64_t edge = cube.edge_voxels(options_.shape.grid_levels);
    if (edge > std::max(options_.longest_edge, kSmallestEdge)) return split(queued);
    progress_.subvolume_begun(queued.subvolume.id);
    StoredSubvolume built = queued.subvolume;
    if (!build_or_copy(queued, built)) return split(queued);
    record_built(built, queued.bin);
    return {};
  }
  std::unique_ptr<CommitQueue> release_commits() { return std::move(commits_); }

  ExecutorCounts counts;

 private:
  // Builds a subvolume of a solid if no triangle touches the subvolume.
  std::vector<QueuedSubvolume> build_without_shell(const QueuedSubvolume& queued) {
    const Cube& cube = queued.subvolume.cube;
    progress_.subvolume_begun(queued.subvolume.id);
    StoredSubvolume built = queued.subvolume;
    if (options_.rows->find(cube).unit == SolidUnit::kEmptyUnit) {
      const UnitViews views =
          views_of_empty(read_entry(cube).entry, cube, options_.shape.grid_levels);
      if (views.is_inside()) {
        built.artifact = add_full_cubes(segment_, options_.shape, {&cube, 1});
        built.summary = full_summary(cube, options_.shape, views.is_disputed());
      }
    }
    record_built(built, queued.bin);
    return {};
  }

  struct ChargedEntry {
    MemoryCharge charge;
    SolidEntry entry;
  };
  ChargedEntry read_entry(const Cube& cube) {
    MemoryCharge charge(share_, row_bytes(cube, options_.shape.grid_levels),
                        "the sample rows of a solid");
    return {std::move(charge), options_.rows->read_entry(cube)};
  }

  // Sets the artifact and the summary of `built`: copies them from the cache, or builds the
  // subvolume. Returns false if the subvolume must be split.
  bool build_or_copy(const QueuedSubvolume& queued, StoredSubvolume& built) {
    std::optional<ChargedEntry> rows;
    if (options_.rows != nullptr) rows.emplace(read_entry(built.cube));
    SubvolumeTask task{options_.shape.grid_levels, built.cube, options_.shape.hash_bits};
    task.rule = options_.rule;
    if (rows) task.solid = &rows->entry;
    const auto triangles = triangles_.open(queued.bin);
    std::optional<std::string> key;
    if (options_.cache != nullptr) {
      MemoryBudget key_share(WorkerMemory::key_bytes(share_.limit()), &share_);
      key = ArtifactCache::key(task, *triangles, key_share);
    }
    if (key && options_.cache->find(*key, task, built, segment_)) {
      ++counts.cached;
      return true;
    }
    if (!build_artifact(task, *triangles, built)) return false;
    if (key && !built.summary.empty()) add_to_cache(*key, task, built);
    return true;
  }

  // Builds the subvolume, and sets the artifact and the summary of `built`. Returns false if the
  // subvolume must be split.
  bool build_artifact(const SubvolumeTask& task, TriangleStream& triangles,
                      StoredSubvolume& built) {
    ArtifactWriter artifact(segment_, options_.shape);
    if (backend_->build(task, triangles, share_, cancel_, artifact, built.summary) ==
        BuildOutcome::kNeedsSplit)
      return false;
    if (built.summary.empty()) return true;
    const ArtifactRoot root{task.cube, 0, built.summary.root_hash, built.summary.voxels,
                            built.summary.svo_nodes};
    built.artifact = artifact.finish({&root, 1});
    return true;
  }

  void record_built(const StoredSubvolume& built, BinId bin) {
    commits_->add_built(built, bin);
    SubvolumeStatus status = status_of(built, options_.shape.grid_levels);
    status.built = true;
    progress_.subvolume_built(status);
  }

  void add_to_cache(const std::string& key, const SubvolumeTask& task,
                    const StoredSubvolume& built) {
    segment_.flush();
    if (!written_segment_)
      written_segment_ = files_.open_own(segment_path(options_.segment_folder, segment_.id()));
    options_.cache->add(key, task, *written_segment_, built);
  }

  std::vector<QueuedSubvolume> split(const QueuedSubvolume& whole) {
    const StoredSubvolume& subvolume = whole.subvolume;
    if (subvolume.cube.edge_voxels(options_.shape.grid_levels) <= kSmallestEdge)
      throw Error(ErrorCode::kOutOfMemory,
                  "a subvolume of " + std::to_string(kSmallestEdge) +
                      " voxels per edge does not fit a worker's share of " +
                      size_text(share_.limit()) + ": expected more memory (" +
                      option_text("memory") + ")");
    ++counts.split;
    std::optional<SplitSolid> solid;
    if (options_.rows != nullptr) solid.emplace(SplitSolid{*options_.rows, share_});
    return split_subvolume(whole, options_.shape.grid_levels, triangles_, jobs_, progress_, cancel_,
                           solid ? &*solid : nullptr);
  }

  const ExecutorOptions& options_;
  TriangleStore& triangles_;
  JobStore& jobs_;
  FileSystem& files_;
  const CancelToken& cancel_;
  Progress& progress_;
  MemoryBudget share_;
  std::unique_ptr<CommitQueue> commits_;
  SegmentWriter& segment_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<ReadableFile> written_segment_;
};

}  // namespace

ExecutorCounts build_subvolumes(const ExecutorOptions& options,
                                std::vector<QueuedSubvolume> subvolumes, TriangleStore& triangles,
                                JobStore& jobs, CommitQueues& unfinished, MemoryBudget& budget,
                                const BuildContext& context) {
  uint64_t total = options.built + subvolumes.size();
  Queue queue(std::move(subvolumes));
  const auto memory = WorkerMemory::divide(budget.available(), options.threads);
  std::vector<std::unique_ptr<Worker>> workers;
  for (unsigned i = 0; i < memory.workers; ++i)
    workers.push_back(
        std::make_unique<Worker>(options, i, triangles, jobs, budget, memory.share_bytes, context));
  std::mutex progress_mutex;
  const auto work = [&](Worker& worker) {
    while (const auto subvolume = queue.pop()) {
      const auto parts = worker.build(*subvolume);
      queue.done(parts);
      std::lock_guard lock(progress_mutex);
      if (parts.empty()) {
        context.progress.advance(1);
      } else {
        context.progress.set_total(total += parts.size() - 1);
      }
    }
  };
  parallel_for(static_cast<unsigned>(workers.size()), workers.size(),
               [&](unsigned, size_t i) { queue.guard([&] { work(*workers[i]); }); });
  ExecutorCounts counts;
  for (const auto& worker : workers) {
    counts.split += worker->counts.split;
    counts.cached += worker->counts.cached;
    auto commits = worker->release_commits();
    if (!queue.has_failed()) queue.guard([&] { commits->finish(); });
    unfinished.add(std::move(commits));
  }
  // Finished subvolumes are kept even if a worker has failed.
  if (queue.has_failed()) queue.guard([&] { unfinished.commit(); });
  queue.rethrow_failure();
  return counts;
}

}  // namespace voxdag
