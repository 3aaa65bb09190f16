#include "merge/pass/merge_pass.h"

#include <algorithm>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "merge/pass/merge_level.h"

namespace voxdag {
namespace {

class Pass {
 public:
  Pass(const MergeContext& context, const PassTask& task, LevelOutput& output,
       PassProgress progress)
      : context_(context), task_(task), output_(output), done_(std::move(progress)) {}

  std::vector<ArtifactRoot> run(const std::function<void(const PassProgress&)>& after_level) {
    const uint32_t highest = task_.is_final ? 0 : highest_root();
    reserve_memory();
    uint32_t level = done_.level.value_or(task_.shape.brick_level() + 1);
    while (level-- > highest) {
      merge_all_runs(level);
      if (after_level) after_level(done_);
    }
    if (task_.is_final && done_.placed.size() != 1)
      throw Error(ErrorCode::kCorrupt,
                  "the merge found " + std::to_string(done_.placed.size()) +
                      " root nodes for the complete grid: expected exactly one, from subvolumes "
                      "that do not overlap");
    return std::move(done_.roots);
  }

 private:
  uint32_t highest_root() const {
    uint32_t highest = task_.shape.grid_levels;
    for (const ArtifactReader& artifact : task_.artifacts)
      for (const ArtifactRoot& root : artifact.roots())
        highest = std::min(highest, root.cube.level);
    return highest;
  }

  void merge_all_runs(uint32_t level) {
    const RowFormat format{level == task_.shape.brick_level(), done_.wide};
    std::vector<ArtifactRun> artifact_runs;
    for (const ArtifactReader& artifact : task_.artifacts)
      artifact_runs.emplace_back(artifact, level, format.wide);
    const TopTreeRun top(task_.shape.hash_bits,
                         task_.is_final ? std::move(done_.placed) : std::vector<PlacedNode>(),
                         format.wide);
    context_.progress.expect_more(top.rows());
    std::vector<const LevelRun*> runs;
    std::vector<uint64_t> rows;
    for (const ArtifactRun& run : artifact_runs) runs.push_back(&run);
    runs.push_back(&top);
    RowCount total;
    for (const LevelRun* run : runs) {
      rows.push_back(run->rows());
      total.add(run->size());
    }

    PositionMaps maps(rows, output_.is_wide(max_positions(total)), context_.plan.resident_bytes,
                      context_.scratch, context_.budget);
    output_.begin_level(level);
    const LevelExtent extent =
        merge_level(context_, {.level = level,
                               .format = format,
                               .runs = runs,
                               .child_maps = done_.maps ? &*done_.maps : nullptr,
                               .maps = maps,
                               .output = output_,
                               .memory = memory_});
    output_.end_level(extent);
    if (task_.is_final) context_.report.dag_nodes += extent.nodes;
    place(level, top, maps);
    done_.maps = std::move(maps);
    done_.wide = output_.is_wide(extent.positions);
    done_.level = level;
    if (context_.budget.available() < memory_.bytes() / 4 + bytes_besides_partition())
      memory_.release();
  }

  // Returns the maximum number of positions (merge/load/row.h) that `rows` can take in the output.
  // They take this number if no two rows are equal.
  uint64_t max_positions(const RowCount& rows) const {
    return output_.in_words() ? rows.rows + rows.words : rows.rows;
  }

  // If the budget has enough memory for a hash partition of useful size on every level, allocates
  // it now, and all partitions use it. Otherwise a partition allocates new memory if it is larger
  // than all earlier partitions.
  void reserve_memory() {
    std::vector<LevelRows> levels(task_.shape.grid_levels);
    for (const ArtifactReader& artifact : task_.artifacts)
      for (const ArtifactLevel& level : artifact.levels())
        levels[level.level].add({level.rows, std::max(level.children, kBrickWords * level.rows)});
    RowCount max, useful;
    for (const LevelRows& level : levels) {
      max.raise_to(level.total());
      useful.raise_to(level.useful_rows(context_.plan));
    }
    if (output_.is_wide(max_positions(max))) return;
    const bool resident = max.rows * sizeof(uint32_t) <= context_.plan.resident_bytes;
    const uint64_t bytes = HashPartition::bytes_for(useful, 0);
    if (resident && bytes <= kMaxPartitionBytes &&
        bytes + bytes_besides_partition() + context_.plan.resident_bytes <=
            context_.budget.available())
      memory_.reserve(useful, 0, context_.budget);
  }

  // Returns the bytes that merging a level needs in addition to the hash partition: the workers'
  // memory and one level's position maps.
  uint64_t bytes_besides_partition() const {
    return bytes_for_workers(context_.plan) + context_.plan.resident_bytes;
  }

  // Stores the positions of this level's top nodes and subvolume roots in done_.
  void place(uint32_t level, const TopTreeRun& top, const PositionMaps& maps) {
    done_.placed.clear();
    for (size_t row = 0; row < top.rows(); ++row)
      done_.placed.push_back({top.cube(row), top.hash(row), maps.at(task_.artifacts.size(), row)});
    if (task_.is_final) context_.report.svo_nodes += top.rows();
    for (size_t run = 0; run < task_.artifacts.size(); ++run)
      for (ArtifactRoot root : task_.artifacts[run].roots()) {
        if (root.cube.level != level) continue;
        const uint64_t position = maps.at(run, root.index);
        done_.placed.push_back({root.cube, root.hash, position});
        // A position in the global file can have over 32 bits, and the cast truncates it. This is
        // harmless: nothing uses the `index` of a root in the global file.
        root.index = static_cast<uint32_t>(position);
        done_.roots.push_back(root);
      }
  }

  const MergeContext& context_;
  const PassTask& task_;
  LevelOutput& output_;
  PassProgress done_;
  PartitionMemory memory_;
};

}  // namespace

std::vector<ArtifactRoot> run_merge_pass(
    const MergeContext& context, const PassTask& task, LevelOutput& output, PassProgress progress,
    const std::function<void(const PassProgress&)>& after_level) {
  return Pass(context, task, output, std::move(progress)).run(after_level);
}

}  // namespace voxdag
