#include "merge/pass/merge_level.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "merge/fallback/hash_group_merge.h"
#include "merge/fallback/heap_merge.h"
#include "merge/sort/bucket_sorter.h"

namespace voxdag {
namespace {

// Partitions with fewer rows are merged by one thread.
constexpr uint64_t kMinParallelRows = 16384;
// Rows per bucket: as many as fit in a core's cache while they are sorted.
constexpr uint64_t kBucketRows = 8192;
// Minimum rows per bucket and run, on average. With many runs, buckets are larger than kBucketRows,
// so that a bucket has several adjacent rows of each run.
constexpr uint64_t kMinBucketRowsPerRun = 16;

// Walks the rows of one slice (hash_partition.h) within one bucket.
class SliceCursor {
 public:
  SliceCursor(const HashPartition& partition, size_t slice, size_t bucket) : partition_(partition) {
    const RunSlice& s = partition.slices()[slice];
    row_ = s.row_base + partition.bucket_begin(bucket, slice).row;
    end_ = s.row_base + partition.bucket_begin(bucket + 1, slice).row;
    word_ = s.word_base + partition.bucket_begin(bucket, slice).word;
  }
  bool at_end() const { return row_ == end_; }
  RowKey row() const {
    return {partition_.hashes()[row_], partition_.masks()[row_], partition_.words() + word_};
  }
  void advance() { word_ += partition_.format().words(partition_.masks()[row_++]); }

 private:
  const HashPartition& partition_;
  uint64_t row_, end_, word_;
};

// Merges the buckets of one hash partition in parallel.
class PartitionMerge {
 public:
  PartitionMerge(const MergeContext& context, const LevelTask& task, HashPartition& partition,
                 unsigned workers, uint64_t first_position)
      : context_(context),
        task_(task),
        partition_(partition),
        workers_(workers),
        position_(first_position) {}

  LevelExtent run() {
    make_sorters();
    const auto merge_bucket = [&](unsigned worker, size_t bucket) {
      try {
        context_.cancel.check();
        const RowCount size = size_of(bucket);
        if (fits(size))
          sort(sorters_[worker], bucket);
        else
          merge_by_rows(bucket);
        context_.progress.advance(size.rows);
      } catch (...) {
        turns_.fail(bucket);
        throw;
      }
    };
    parallel_for(workers_, partition_.bucket_count(), merge_bucket);
    if (!task_.maps.is_resident()) store_positions();
    return extent_;
  }

 private:
  RowCount size_of(size_t bucket) const {
    RowCount size;
    for (size_t s = 0; s < partition_.slices().size(); ++s) {
      const RowOffset begin = partition_.bucket_begin(bucket, s);
      const RowOffset end = partition_.bucket_begin(bucket + 1, s);
      size.add({end.row - begin.row, end.word - begin.word});
    }
    return size;
  }

  // True if a bucket of this size can be sorted within a worker's memory.
  bool fits(const RowCount& size) const {
    return size.rows <= BucketSorter::kMaxRows &&
           BucketSorter::bytes_for(size) <= context_.plan.worker_bytes;
  }

  // Makes one sorter for each worker, large enough for every bucket that fits.
  void make_sorters() {
    RowCount max;
    for (size_t bucket = 0; bucket < partition_.bucket_count(); ++bucket) {
      const RowCount size = size_of(bucket);
      if (fits(size)) max.raise_to(size);
    }
    for (unsigned worker = 0; worker < workers_; ++worker)
      sorters_.emplace_back(context_.budget, task_.format, max);
  }

  void sort(BucketSorter& sorter, size_t bucket) {
    sorter.sort(partition_, bucket, task_.output.in_words());
    if (!turns_.wait_for(bucket)) return;
    const uint64_t position = position_;
    task_.output.add(sorter.unique());
    end_turn({sorter.unique().row_count(), sorter.extent()});
    task_.output.write(position, sorter.unique());
    const uint32_t* from = sorter.positions().data();
    for (size_t s = 0; s < partition_.slices().size(); ++s) {
      const uint32_t rows =
          partition_.bucket_begin(bucket + 1, s).row - partition_.bucket_begin(bucket, s).row;
      uint32_t* to = positions_of(bucket, s);
      if (task_.maps.wide())
        for (uint32_t i = 0; i < rows; ++i) to = put_position(to, position + from[i], true);
      else
        for (uint32_t i = 0; i < rows; ++i) to[i] = static_cast<uint32_t>(position) + from[i];
      from += rows;
    }
  }

  void merge_by_rows(size_t bucket) {
    if (!turns_.wait_for(bucket)) return;
    OrderedRowWriter out(task_.output, task_.format, position_, context_.budget);
    std::vector<SliceCursor> cursors;
    std::vector<uint32_t*> to;
    for (size_t s = 0; s < partition_.slices().size(); ++s) {
      cursors.emplace_back(partition_, s, bucket);
      to.push_back(positions_of(bucket, s));
    }
    uint64_t rows = 0;
    merge_cursors(task_.format, std::span(cursors), [&](size_t s, const RowKey& row) {
      to[s] = put_position(to[s], out.add(row), task_.maps.wide());
      if (++rows % kFrameRows == 0) context_.cancel.check();
    });
    out.flush();
    end_turn({out.nodes(), out.end_position() - position_});
  }

  // Adds the size of the merged bucket to the partition's totals, and passes the turn to the next
  // bucket. Called by the worker whose turn it is.
  void end_turn(const LevelExtent& bucket) {
    extent_.nodes += bucket.nodes;
    extent_.positions += bucket.positions;
    position_ += bucket.positions;
    turns_.end();
  }

  // Returns the address for the positions of the bucket's rows in slice `s`. If the maps are in
  // memory, the address is in the run's map. Otherwise it is in the partition, and
  // store_positions() copies the positions from there to the map.
  uint32_t* positions_of(size_t bucket, size_t s) {
    const RunSlice& slice = partition_.slices()[s];
    const uint64_t row = partition_.bucket_begin(bucket, s).row;
    const uint32_t words = task_.maps.position_words();
    return task_.maps.is_resident() ? task_.maps.words(slice.run) + words * (slice.first_row + row)
                                    : partition_.positions() + words * (slice.row_base + row);
  }

  void store_positions() {
    for (size_t s = 0; s < partition_.slices().size(); ++s) {
      const RunSlice& slice = partition_.slices()[s];
      const uint32_t begin = partition_.bucket_begin(0, s).row;
      const uint32_t end = partition_.bucket_begin(partition_.bucket_count(), s).row;
      task_.maps.store(slice.run, slice.first_row + begin,
                       {positions_of(0, s), (end - begin) * task_.maps.position_words()});
    }
  }

  const MergeContext& context_;
  const LevelTask& task_;
  HashPartition& partition_;
  const unsigned workers_;
  Turns turns_;        // lets the workers output buckets in their order (core/base/parallel_for.h)
  uint64_t position_;  // position of the next bucket; changed only by the worker whose turn it is
  std::vector<BucketSorter> sorters_;
  LevelExtent extent_;  // changed only by the worker whose turn it is
};

uint64_t bucket_rows(const MergeContext& context, const LevelTask& task) {
  const uint64_t rows = std::max<uint64_t>(kBucketRows, kMinBucketRowsPerRun * task.runs.size());
  // A bucket of average size gets at most half of a worker's memory, because some buckets are
  // larger than average.
  const uint64_t row_bytes = BucketSorter::bytes_for({1, task.format.max_words()});
  return std::min(rows, context.plan.worker_bytes / (2 * row_bytes));
}

// Returns the number of words per row that a partition holds for the row's position. It is 0 if the
// position maps are in memory, because then positions are written directly to the maps.
uint32_t held_position_words(const LevelTask& task) {
  return task.maps.is_resident() ? 0 : task.maps.position_words();
}

// Returns the number of threads that merge a partition with these slices. Starting threads for few
// rows takes longer than merging the rows.
unsigned workers_for(std::span<const RunSlice> slices, unsigned max_workers) {
  uint64_t rows = 0;
  for (const RunSlice& slice : slices) rows += slice.size.rows;
  return rows < kMinParallelRows ? 1 : max_workers;
}

LevelExtent merge_partition(const MergeContext& context, const LevelTask& task,
                            const HashInterval& interval, uint64_t first_position) {
  HashPartition partition(task.runs, HashPartition::slices_within(task.runs, interval), interval,
                          bucket_rows(context, task), held_position_words(task), task.memory,
                          context.budget);
  const unsigned workers = workers_for(partition.slices(), context.plan.workers);
  partition.load(task.child_maps, {workers, context.plan.worker_bytes}, context.budget,
                 context.cancel);
  return PartitionMerge(context, task, partition, workers, first_position).run();
}

// Called if the rows with this hash do not fit in a partition. Throws Error{kOutOfMemory} unless
// they are in more than two frames of some run. The memory plan has space for two frames of every
// run, so a group with at most two frames in each run should have fit.
void check_group_is_large(const LevelTask& task, uint64_t hash) {
  for (const LevelRun* run : task.runs) {
    const FrameSpan frames = run->frames_within({hash, hash});
    if (frames.end - frames.begin > 2) return;
  }
  throw Error(ErrorCode::kOutOfMemory, "out of memory: merging level " +
                                           std::to_string(task.level) + " of " +
                                           std::to_string(task.runs.size()) +
                                           " inputs takes more than the merge's share of memory: "
                                           "expected more memory (" +
                                           option_text("memory") + ")");
}

}  // namespace

uint64_t bytes_for_workers(const MergeMemory& plan) {
  return plan.workers * std::max(plan.worker_bytes, OrderedRowWriter::bytes());
}

LevelExtent merge_level(const MergeContext& context, const LevelTask& task) {
  LevelRows rows;
  for (const LevelRun* run : task.runs) rows.add(run->size());
  context.report.input_nodes += rows.total().rows;
  const uint64_t available = context.budget.available() + task.memory.bytes();
  const uint64_t for_workers = bytes_for_workers(context.plan);
  const uint64_t partition_bytes =
      MergeMemory::partition_bytes_within(available - std::min(available, for_workers));
  const uint32_t position_words = held_position_words(task);
  // Every partition loads all spilled maps of the level below, so then the number of partitions
  // should be small.
  const bool is_spilled = task.child_maps && !task.child_maps->is_resident();
  const uint64_t useful_bytes =
      is_spilled ? partition_bytes
                 : std::min(partition_bytes, rows.useful_bytes(context.plan, position_words));
  const auto widest_interval = [&](uint64_t first) {
    const auto useful =
        HashPartition::widest_interval(task.runs, first, useful_bytes, position_words);
    if (useful || useful_bytes == partition_bytes) return useful;
    // The rows with hash `first` alone take more than the useful size.
    return HashPartition::widest_interval(task.runs, first, partition_bytes, position_words);
  };
  LevelExtent extent;
  HashInterval done{0, 0};
  for (uint64_t first = 0;; first = done.last + 1) {
    const auto interval = widest_interval(first);
    LevelExtent part;
    if (interval) {
      done = *interval;
      part = merge_partition(context, task, done, extent.positions);
      ++context.report.hash_partitions;
    } else {
      check_group_is_large(task, first);
      done = {first, first};
      part = merge_hash_group(context, task, first, extent.positions, partition_bytes);
      ++context.report.streamed_groups;
    }
    extent.add(part, task.level, task.output.in_words());
    if (done.last == ~uint64_t{0}) return extent;
  }
}

}  // namespace voxdag
