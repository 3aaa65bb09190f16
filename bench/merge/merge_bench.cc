// Measures the speed of the merge and of its steps, in rows (of all runs) per CPU second.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <map>
#include <memory>

#include "bench/merge/synthetic_runs.h"
#include "merge/fallback/heap_merge.h"
#include "merge/load/hash_partition.h"
#include "merge/merge.h"
#include "merge/pass/merge_level.h"
#include "merge/plan/artifact_set.h"
#include "merge/sort/bucket_sorter.h"

namespace voxdag {
namespace {

constexpr uint64_t kRows = 8'000'000;
constexpr uint64_t kGiB = uint64_t{1} << 30;

// Synthetic artifacts in a temporary folder, for each number of runs. They are generated when they
// are first used.
class Fixtures {
 public:
  ~Fixtures() { std::filesystem::remove_all(folder_); }
  const std::string& folder() const { return folder_; }
  const SyntheticRuns& of(size_t runs) {
    std::unique_ptr<SyntheticRuns>& made = made_[runs];
    if (!made) {
      const std::string folder = folder_ + "/" + std::to_string(runs);
      std::filesystem::create_directory(folder);
      made = std::make_unique<SyntheticRuns>(folder, runs, kRows);
    }
    return *made;
  }

 private:
  std::string folder_ =
      make_temporary_folder(std::filesystem::temp_directory_path() / "voxdag-bench-");
  std::map<size_t, std::unique_ptr<SyntheticRuns>> made_;
};

Fixtures& fixtures() {
  static Fixtures all;
  return all;
}

// Measures the complete merge, including writing the global file. Arguments: number of runs, memory
// in MiB.
void BM_Merge(benchmark::State& state) {
  const SyntheticRuns& runs = fixtures().of(static_cast<size_t>(state.range(0)));
  MergeInputs inputs;
  inputs.shape.grid_levels = SyntheticRuns::kGridLevels;
  inputs.artifacts = runs.refs();
  inputs.open_segment = [&](uint32_t) { return runs.open(); };
  inputs.scratch_folder = fixtures().folder() + "/scratch";
  Grid grid;
  grid.levels = inputs.shape.grid_levels;
  MergeReport report;
  for (auto _ : state) {
    MemoryBudget budget(static_cast<uint64_t>(state.range(1)) << 20);
    NoProgress progress;
    CancelToken cancel;
    GlobalFileWriter out(system_files(), fixtures().folder() + "/merged.vdag", grid, 64);
    report = merge_sub_dags(inputs, system_files(), out, budget, 1, progress, cancel);
  }
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * report.input_nodes));
  state.counters["passes"] = report.passes;
  state.counters["partitions"] = static_cast<double>(report.hash_partitions);
  state.counters["unique_share"] =
      static_cast<double>(report.dag_nodes) / static_cast<double>(report.input_nodes);
}
BENCHMARK(BM_Merge)
    ->Args({1, 8192})
    ->Args({64, 8192})
    ->Args({512, 8192})
    ->Args({2048, 8192})
    ->Args({512, 256})
    ->Args({512, 40})
    ->Unit(benchmark::kMillisecond);

// Iterates over the rows of a slice: the rows that a partition has from one run.
class SliceRows {
 public:
  SliceRows(const HashPartition& partition, const RunSlice& slice)
      : partition_(&partition),
        row_(slice.row_base),
        end_(slice.row_base + slice.size.rows),
        word_(slice.word_base) {}
  bool at_end() const { return row_ == end_; }
  RowKey row() const {
    return {partition_->hashes()[row_], partition_->masks()[row_], partition_->words() + word_};
  }
  void advance() { word_ += partition_->format().words(partition_->masks()[row_++]); }

 private:
  const HashPartition* partition_;
  uint64_t row_, end_, word_;
};

// One level of all runs. The member functions run steps of the merge on this level, without writing
// an output file.
class OneLevel {
 public:
  OneLevel(size_t runs, uint32_t levels_above_bricks)
      : source_(fixtures().of(runs)),
        survey_(survey_artifacts(source_.refs(), open(),
                                 {.grid_levels = SyntheticRuns::kGridLevels}, false)),
        artifacts_(survey_.in_morton_order, open(), {.grid_levels = SyntheticRuns::kGridLevels},
                   budget_) {
    const uint32_t level = SyntheticRuns::kGridLevels - 2 - levels_above_bricks;
    std::vector<uint64_t> rows, rows_below;
    for (const ArtifactReader& artifact : artifacts_.readers()) {
      runs_.push_back(std::make_unique<ArtifactRun>(artifact, level, false));
      pointers_.push_back(runs_.back().get());
      rows.push_back(runs_.back()->rows());
      rows_below.push_back(levels_above_bricks ? artifact.level(level + 1)->rows : 0);
      total_ += rows.back();
    }
    maps_.emplace(rows, false, kGiB, scratch_, budget_);
    below_.emplace(rows_below, false, kGiB, scratch_, budget_);
    for (size_t run = 0; run < runs; ++run)
      for (uint64_t row = 0; row < rows_below[run]; ++row)
        below_->words(run)[row] = static_cast<uint32_t>(7 * row);
  }

  HashPartition partition() {
    HashPartition made(pointers_, HashPartition::slices_within(pointers_, {}), {},
                       std::max<uint64_t>(8192, 8 * pointers_.size()), 0, memory_, budget_);
    return made;
  }
  void load(HashPartition& partition) { partition.load(&*below_, {1, kGiB}, budget_, cancel_); }
  uint64_t rows() const { return total_; }

  // Decodes all frames and discards them.
  void decode() {
    Frame frame;
    for (const auto& run : runs_)
      for (size_t f = 0; f < run->frames().size(); ++f) run->read_frame(f, frame);
  }
  // Sorts a loaded partition bucket by bucket, as the merge does. Returns the number of unique
  // rows.
  uint64_t sort_buckets(const HashPartition& partition) {
    uint64_t unique = 0;
    RowCount largest{};
    for (size_t b = 0; b < partition.bucket_count(); ++b) {
      RowCount size{};
      for (size_t s = 0; s < partition.slices().size(); ++s) {
        const RowOffset begin = partition.bucket_begin(b, s),
                        end = partition.bucket_begin(b + 1, s);
        size.rows += end.row - begin.row;
        size.words += end.word - begin.word;
      }
      largest = {std::max(largest.rows, size.rows), std::max(largest.words, size.words)};
    }
    BucketSorter sorter(budget_, partition.format(), largest);
    for (size_t b = 0; b < partition.bucket_count(); ++b) {
      sorter.sort(partition, b, true);
      unique += sorter.unique().row_count();
    }
    return unique;
  }
  // Merges the slices of a loaded partition by a k-way heap. Returns the number of unique rows.
  static uint64_t merge_by_heap(const HashPartition& partition) {
    std::vector<SliceRows> cursors;
    for (const RunSlice& slice : partition.slices()) cursors.emplace_back(partition, slice);
    uint64_t unique = 0;
    RowKey last{};
    merge_cursors(partition.format(), std::span(cursors), [&](size_t, const RowKey& row) {
      unique += unique == 0 || compare_rows(partition.format(), last, row) != 0;
      last = row;
    });
    return unique;
  }

  // Runs all steps of the merge of this level. The output discards the merged rows.
  void merge(bool bricks) {
    struct Nowhere : LevelOutput {
      bool in_words() const override { return true; }
      bool is_wide(uint64_t) const override { return false; }
      void begin_level(uint32_t) override {}
      void add(const MergedRows&) override {}
      void write(uint64_t, const MergedRows&) override {}
      void end_level(const LevelExtent&) override {}
    } nowhere;
    MergeReport report;
    NoProgress silent;
    MergeProgress progress(silent);
    const MergeContext context{
        scratch_, budget_, MergeMemory::divide(budget_.available(), 1, UINT64_MAX),
        progress, cancel_, report};
    merge_level(context, {1, {.bricks = bricks}, pointers_, &*below_, *maps_, nowhere, memory_});
  }

 private:
  OpenSegment open() const {
    return [this](uint32_t) { return source_.open(); };
  }

  const SyntheticRuns& source_;
  MemoryBudget budget_{8 * kGiB};
  ScratchFolder scratch_{system_files(), fixtures().folder() + "/scratch"};
  CancelToken cancel_;
  ArtifactSurvey survey_;
  ArtifactSet artifacts_;
  std::vector<std::unique_ptr<ArtifactRun>> runs_;
  std::vector<const LevelRun*> pointers_;
  std::optional<PositionMaps> maps_, below_;
  PartitionMemory memory_;
  uint64_t total_ = 0;
};

// Measures decoding. Arguments of this benchmark and the next ones: number of runs, levels above
// the bricks.
void BM_Decode(benchmark::State& state) {
  OneLevel level(static_cast<size_t>(state.range(0)), static_cast<uint32_t>(state.range(1)));
  for (auto _ : state) level.decode();
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * level.rows()));
}

// Measures loading: decoding the rows of a level, and rewiring them, into a hash partition.
void BM_LoadPartition(benchmark::State& state) {
  OneLevel level(static_cast<size_t>(state.range(0)), static_cast<uint32_t>(state.range(1)));
  for (auto _ : state) {
    HashPartition partition = level.partition();
    level.load(partition);
  }
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * level.rows()));
}

// Measures decoding, rewiring and merging, without output.
void BM_MergeLevel(benchmark::State& state) {
  OneLevel level(static_cast<size_t>(state.range(0)), static_cast<uint32_t>(state.range(1)));
  for (auto _ : state) level.merge(state.range(1) == 0);
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * level.rows()));
}

// Measures sorting a loaded partition into the total order: by buckets, or by a k-way heap merge of
// the runs.
template <bool kByHeap>
void BM_SortPartition(benchmark::State& state) {
  OneLevel level(static_cast<size_t>(state.range(0)), static_cast<uint32_t>(state.range(1)));
  HashPartition partition = level.partition();
  level.load(partition);
  uint64_t unique = 0;
  for (auto _ : state)
    unique = kByHeap ? OneLevel::merge_by_heap(partition) : level.sort_buckets(partition);
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * level.rows()));
  state.counters["unique"] = static_cast<double>(unique);
}

void levels(benchmark::internal::Benchmark* benchmark) {
  for (const int runs : {64, 512})
    for (const int level : {0, 1}) benchmark->Args({runs, level});
  benchmark->Unit(benchmark::kMillisecond);
}
BENCHMARK(BM_Decode)->Apply(levels);
BENCHMARK(BM_LoadPartition)->Apply(levels);
BENCHMARK(BM_MergeLevel)->Apply(levels);
BENCHMARK(BM_SortPartition<false>)->Name("BM_SortByBuckets")->Apply(levels);
BENCHMARK(BM_SortPartition<true>)->Name("BM_SortByHeap")->Apply(levels);

}  // namespace
}  // namespace voxdag

BENCHMARK_MAIN();
