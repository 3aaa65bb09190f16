#include "scheduler/execute/executor.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

#include "core/base/error.h"
#include "scheduler/job/job_progress.h"
#include "scheduler/triangles/distribute.h"

namespace voxdag {
namespace {

// Bytes of half-filled chunks while one subvolume is split.
constexpr size_t kSplitBufferBytes = size_t{512} << 10;
// Pages that a backend may keep uncharged beside a full share; more make way for what is charged.
constexpr uint64_t kPageCacheBytesPerWorker = uint64_t{8} << 20;
// No more than this many files are held open for writing.
constexpr uint64_t kMaxWorkers = 256;

// As many as were asked for, unless their shares would be too small for the smallest subvolume.
unsigned workers_within(uint64_t bytes, unsigned wanted) {
  const uint64_t least = kSmallestBudget + kSegmentWriterBytes + kPageCacheBytesPerWorker;
  return static_cast<unsigned>(
      std::clamp<uint64_t>(bytes / least, 1, std::min<uint64_t>(wanted, kMaxWorkers)));
}

bool lighter(const QueuedSubvolume& a, const QueuedSubvolume& b) {
  return a.subvolume.weight < b.subvolume.weight;
}

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
  // Runs a worker's code; what it throws stops all workers.
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
  // These two once all workers have stopped.
  bool has_failed() const { return failure_ != nullptr; }
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
  Worker(const ExecutorOptions& options, uint32_t number, TriangleBins& bins, JobStore& store,
         MemoryBudget& budget, uint64_t share_bytes, const BuildContext& context)
      : options_(options),
        bins_(bins),
        store_(store),
        files_(context.files),
        cancel_(context.cancel),
        progress_(context.progress),
        share_(share_bytes, &budget),
        journal_(std::make_unique<CommitQueue>(
            store,
            std::make_unique<SegmentWriter>(context.files, options.segment_folder,
                                            options.first_segment_id + number, budget),
            bins, options.checkpoint_interval_s)),
        segment_(journal_->segment()),
        backend_(options.open_backend()) {}

  // Builds one subvolume, or answers with the eight that replace it.
  std::vector<QueuedSubvolume> build(const QueuedSubvolume& queued) {
    cancel_.check();
    const StoredSubvolume& subvolume = queued.subvolume;
    const int64_t edge = subvolume.cube.edge_voxels(options_.grid_levels);
    if (edge > std::max(options_.longest_edge, kSmallestEdge)) return split(queued);
    const SubvolumeTask task{options_.grid_levels, subvolume.cube, options_.hash_bits};
    const auto triangles = bins_.open(queued.bin);
    std::optional<std::string> key;
    if (options_.cache) {
      // The backend's pages do not make way for it.
      MemoryBudget beside_pages(share_.limit() / 8 * 7, &share_);
      key = ArtifactCache::key(task, *triangles, beside_pages);
      StoredSubvolume copied = subvolume;
      if (key && options_.cache->find(*key, options_.grid_levels, copied, segment_)) {
        bins_.drop(queued.bin);
        ++counts.cached;
        record_built(copied, queued.kept);
        return {};
      }
    }
    ArtifactWriter artifact(segment_, options_.grid_levels, options_.hash_bits);
    StoredSubvolume built = subvolume;
    if (backend_->build(task, *triangles, share_, cancel_, artifact, built.summary) ==
        BuildOutcome::kOutgrown)
      return split(queued);
    bins_.drop(queued.bin);
    if (!built.summary.empty()) {
      const ArtifactRoot root{subvolume.cube, 0, built.summary.root_hash, built.summary.voxels,
                              built.summary.svo_nodes};
      built.artifact = artifact.finish({&root, 1});
      if (key) share(*key, built.artifact);
    }
    record_built(built, queued.kept);
    return {};
  }
  CommitQueue& journal() { return *journal_; }
  std::unique_ptr<CommitQueue> take_journal() { return std::move(journal_); }

  ExecutorCounts counts;

 private:
  void record_built(const StoredSubvolume& built, std::optional<BinId> kept) {
    journal_->built(built, kept);
    SubvolumeStatus status = status_of(built, options_.grid_levels);
    status.built = true;
    progress_.subvolume_built(status);
  }

  void share(const std::string& key, const ArtifactRef& artifact) {
    segment_.flush();
    if (!written_segment_)
      written_segment_ = files_.open_read(segment_path(options_.segment_folder, segment_.id()));
    options_.cache->add(key, *written_segment_, artifact);
  }

  std::vector<QueuedSubvolume> split(const QueuedSubvolume& whole) {
    const StoredSubvolume& subvolume = whole.subvolume;
    if (subvolume.cube.edge_voxels(options_.grid_levels) <= kSmallestEdge)
      throw Error(ErrorCode::kOutOfMemory,
                  "a subvolume of " + std::to_string(kSmallestEdge) +
                      " voxels per edge does not fit a worker's share of " +
                      std::to_string(share_.limit()) + " bytes: give it more memory (--memory)");
    std::vector<Cube> parts(8);
    std::vector<BinId> part_bins(8);
    for (int c = 0; c < 8; ++c) {
      parts[c] = subvolume.cube.child(c);
      part_bins[c] = bins_.add_bin();
    }
    const CubeTree tree(options_.grid_levels, subvolume.cube, parts);
    distribute(bins_, whole.bin, tree, part_bins, kSplitBufferBytes, cancel_);
    std::vector<QueuedSubvolume> queued;
    std::vector<Cube> cubes;
    for (int c = 0; c < 8; ++c) {
      if (bins_.count(part_bins[c]) == 0) continue;
      cubes.push_back(parts[c]);
      queued.push_back({StoredSubvolume{}, part_bins[c], whole.kept});
      queued.back().subvolume.cube = parts[c];
      queued.back().subvolume.weight = subvolume.weight / 8;
    }
    const std::vector<SubvolumeId> ids = store_.record_split(subvolume, cubes);
    std::vector<SubvolumeStatus> statuses;
    for (size_t i = 0; i < ids.size(); ++i) {
      queued[i].subvolume.id = ids[i];
      statuses.push_back(status_of(queued[i].subvolume, options_.grid_levels));
    }
    progress_.subvolume_split(subvolume.id, statuses);
    if (whole.kept) {
      bins_.hold(*whole.kept, queued.size());
      bins_.release(*whole.kept);
    }
    ++counts.split;
    return queued;
  }

  const ExecutorOptions& options_;
  TriangleBins& bins_;
  JobStore& store_;
  FileSystem& files_;
  const CancelToken& cancel_;
  Progress& progress_;
  MemoryBudget share_;
  std::unique_ptr<CommitQueue> journal_;
  SegmentWriter& segment_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<ReadableFile> written_segment_;
};

}  // namespace

ExecutorCounts build_subvolumes(const ExecutorOptions& options, std::vector<QueuedSubvolume> heap,
                                TriangleBins& bins, JobStore& store, CommitQueues& open,
                                MemoryBudget& budget, const BuildContext& context) {
  uint64_t total = heap.size();
  Queue queue(std::move(heap));
  const unsigned worker_count = workers_within(budget.available(), options.threads);
  const uint64_t share_bytes =
      budget.available() / worker_count - kSegmentWriterBytes - kPageCacheBytesPerWorker;
  std::vector<std::unique_ptr<Worker>> workers;
  for (unsigned i = 0; i < worker_count; ++i)
    workers.push_back(
        std::make_unique<Worker>(options, i, bins, store, budget, share_bytes, context));
  std::mutex progress_mutex;
  const auto work = [&](Worker& worker) {
    while (const auto subvolume = queue.take()) {
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
  std::vector<std::thread> threads;
  queue.guard([&] {
    for (const auto& worker : workers)
      threads.emplace_back([&work, &queue, &worker] { queue.guard([&] { work(*worker); }); });
  });
  for (std::thread& thread : threads) thread.join();
  ExecutorCounts sum;
  for (const auto& worker : workers) {
    sum.split += worker->counts.split;
    sum.cached += worker->counts.cached;
    if (!queue.has_failed()) queue.guard([&] { worker->journal().announce(); });
    open.add(worker->take_journal());
  }
  // What is finished is not lost.
  if (queue.has_failed()) queue.guard([&] { open.commit(); });
  queue.rethrow_failure();
  return sum;
}

}  // namespace voxdag
