#include "scheduler/executor.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "core/dag/brick.h"
#include "scheduler/distribute.h"

namespace voxdag {
namespace {

// Bytes of half-filled chunks while one subvolume is split.
constexpr size_t kSplitBufferBytes = size_t{512} << 10;

bool lighter(const QueuedSubvolume& a, const QueuedSubvolume& b) { return a.weight < b.weight; }

// The subvolumes left, shared by the workers. It ends when none is left and none is being built,
// since building one may give eight more.
class Queue {
 public:
  explicit Queue(std::vector<QueuedSubvolume> heap) : heap_(std::move(heap)) {
    std::make_heap(heap_.begin(), heap_.end(), lighter);
  }
  std::optional<QueuedSubvolume> take() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return failure_ || !heap_.empty() || in_flight_ == 0; });
    if (failure_ || heap_.empty()) return std::nullopt;
    std::pop_heap(heap_.begin(), heap_.end(), lighter);
    const QueuedSubvolume next = heap_.back();
    heap_.pop_back();
    ++in_flight_;
    return next;
  }
  // `parts` replace the subvolume that was taken (none if it was built).
  void done(const std::vector<QueuedSubvolume>& parts) {
    std::lock_guard lock(mutex_);
    --in_flight_;
    for (const QueuedSubvolume& part : parts) {
      heap_.push_back(part);
      std::push_heap(heap_.begin(), heap_.end(), lighter);
    }
    changed_.notify_all();
  }
  void fail(std::exception_ptr failure) {
    std::lock_guard lock(mutex_);
    if (!failure_) failure_ = failure;
    changed_.notify_all();
  }
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
  Worker(const ExecutorOptions& options, uint32_t id, TriangleBins& bins, FileSystem& files,
         MemoryBudget& budget, uint64_t share_bytes, const CancelToken& cancel)
      : options_(options),
        bins_(bins),
        cancel_(cancel),
        share_(share_bytes, &budget),
        segment_(files, options.segment_folder, id, budget),
        backend_(options.open_backend()) {}

  // Builds one subvolume, or answers with the eight that replace it.
  std::vector<QueuedSubvolume> build(const QueuedSubvolume& subvolume) {
    const int64_t edge = subvolume.cube.edge_voxels(options_.grid_levels);
    if (edge > std::max(options_.longest_edge, kSmallestEdge)) return split(subvolume);
    const SubvolumeTask task{options_.grid_levels, subvolume.cube, options_.hash_bits};
    const auto triangles = bins_.open(subvolume.bin);
    ArtifactWriter artifact(segment_, options_.grid_levels, options_.hash_bits);
    SubDagSummary summary;
    if (backend_->build(task, *triangles, share_, cancel_, artifact, summary) ==
        BuildOutcome::kOutgrown)
      return split(subvolume);
    bins_.drop(subvolume.bin);
    ++results.built;
    if (!summary.empty()) admit(subvolume.cube, summary, artifact);
    return {};
  }
  void finish() { segment_.flush(); }

  BuiltSubvolumes results;

 private:
  void admit(const Cube& cube, const SubDagSummary& summary, ArtifactWriter& artifact) {
    const ArtifactRoot root{cube, 0, summary.root_hash, summary.voxels, summary.svo_nodes};
    results.artifacts.push_back(artifact.finish({&root, 1}));
    results.artifact_bytes += results.artifacts.back().bytes;
    results.artifact_nodes += summary.dag_nodes;
  }

  std::vector<QueuedSubvolume> split(const QueuedSubvolume& subvolume) {
    if (subvolume.cube.edge_voxels(options_.grid_levels) <= kSmallestEdge)
      throw Error(ErrorCode::kOutOfMemory, "a subvolume of " + std::to_string(kSmallestEdge) +
                                               " voxels an edge does not fit a worker's share of " +
                                               std::to_string(share_.limit()) +
                                               " bytes: give it more memory (--memory)");
    std::vector<SubvolumePlan> parts(8);
    std::vector<BinId> part_bins(8);
    for (int c = 0; c < 8; ++c) {
      parts[c].cube = subvolume.cube.child(c);
      part_bins[c] = bins_.add_bin();
    }
    const CubeTree tree(options_.grid_levels, subvolume.cube, parts);
    distribute(bins_, subvolume.bin, tree, part_bins, kSplitBufferBytes, cancel_);
    std::vector<QueuedSubvolume> queued;
    for (int c = 0; c < 8; ++c)
      if (bins_.count(part_bins[c]) > 0)
        queued.push_back({parts[c].cube, part_bins[c], subvolume.weight / 8});
    ++results.split;
    return queued;
  }

  const ExecutorOptions& options_;
  TriangleBins& bins_;
  const CancelToken& cancel_;
  MemoryBudget share_;
  SegmentWriter segment_;
  std::unique_ptr<Backend> backend_;
};

}  // namespace

BuiltSubvolumes build_subvolumes(const ExecutorOptions& options, std::vector<QueuedSubvolume> heap,
                                 TriangleBins& bins, FileSystem& files, MemoryBudget& budget,
                                 Progress& progress, const CancelToken& cancel) {
  uint64_t total = heap.size();
  Queue queue(std::move(heap));
  const uint64_t share_bytes = budget.available() / options.threads;
  std::vector<std::unique_ptr<Worker>> workers;
  for (unsigned i = 0; i < options.threads; ++i)
    workers.push_back(
        std::make_unique<Worker>(options, i, bins, files, budget, share_bytes, cancel));
  std::mutex progress_mutex;
  const auto work = [&](Worker& worker) {
    try {
      while (const auto subvolume = queue.take()) {
        const auto parts = worker.build(*subvolume);
        queue.done(parts);
        std::lock_guard lock(progress_mutex);
        if (!parts.empty()) progress.set_total(total += parts.size() - 1);
        if (parts.empty()) progress.advance(1);
      }
      worker.finish();
    } catch (...) {
      queue.fail(std::current_exception());
    }
  };
  std::vector<std::thread> threads;
  for (const auto& worker : workers) threads.emplace_back(work, std::ref(*worker));
  for (std::thread& thread : threads) thread.join();
  queue.rethrow_failure();

  BuiltSubvolumes sum;
  for (const auto& worker : workers) {
    const BuiltSubvolumes& part = worker->results;
    sum.artifacts.insert(sum.artifacts.end(), part.artifacts.begin(), part.artifacts.end());
    sum.built += part.built;
    sum.split += part.split;
    sum.artifact_bytes += part.artifact_bytes;
    sum.artifact_nodes += part.artifact_nodes;
  }
  return sum;
}

}  // namespace voxdag
