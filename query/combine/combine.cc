#include "query/combine/combine.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/format/global/diff.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/combine/count_levels.h"
#include "query/combine/join.h"
#include "query/combine/level_writer.h"
#include "query/combine/pair_levels.h"
#include "query/dag/locked_outputs.h"
#include "query/dag/temporary_work.h"

namespace voxdag::query {
namespace {

// Divisors of the memory limit. There are up to nine lists for each level, and up to six sorters
// and four levels of values at any time.
constexpr uint64_t kListShare = 1024;
constexpr uint64_t kSorterShare = 32;
constexpr uint64_t kValueShare = 10;
constexpr uint64_t kWindowShare = 32;
constexpr uint64_t kListBufferBytes = uint64_t{16} << 10;

void refuse_attributes(const voxdag_reader::File& file) {
  const std::vector<Attribute> attributes = attributes_of(file).list();
  if (!attributes.empty())
    throw Error(ErrorCode::kInvalidInput, file.path() + " has " + traits_of(attributes[0]).plural +
                                              ": expected a file without colors and other "
                                              "attributes, which combine cannot join");
}

void refuse_unequal(const voxdag_reader::File& a, const voxdag_reader::File& b) {
  expect_same_grid(a, b, "combined");
  if (a.hash_bits() != b.hash_bits())
    throw Error(ErrorCode::kInvalidInput,
                "only files with equal hash bits can be combined: " + a.path() + " has " +
                    std::to_string(a.hash_bits()) + "; " + b.path() + " has " +
                    std::to_string(b.hash_bits()));
  refuse_attributes(a);
  refuse_attributes(b);
}

class Combination {
 public:
  Combination(const voxdag_reader::File& a, const voxdag_reader::File& b, const CombineSpec& spec,
              FileSystem& files, Progress& progress, const CancelToken& cancel)
      : spec_(spec),
        files_(files),
        progress_(progress),
        cancel_(cancel),
        a_(a, spec.memory_bytes, cancel),
        b_(b, spec.memory_bytes, cancel),
        budget_(spec.memory_bytes),
        work_(files, spec.output + ".work-"),
        scratch_(files, work_.path()),
        space_{scratch_, budget_, share(kListShare), share(kSorterShare),
               std::min(spec.list_bytes, kListBufferBytes)},
        memory_{share(kValueShare), share(kWindowShare)} {}

  // Writes the output. Calls before_publish() before the output gets its final name. If
  // before_publish() throws, the output is discarded.
  CombineReport run(const std::function<void()>& before_publish) {
    GlobalFileWriter out(files_, spec_.output, grid_of(a_.file()), a_.file().hash_bits(),
                         spec_.narrow_words);
    const VoxelCounts counts = write_levels(out);
    if (counts.voxels == 0) progress_.warn("the result has no voxels: the file will have no nodes");
    progress_.begin_stage("write", 1, "files");
    const GlobalFileSummary summary = out.seal(counts, spec_.threads, cancel_);
    before_publish();
    out.publish();
    progress_.advance(1);
    progress_.end_stage();
    return {.grid = grid_of(a_.file()),
            .voxels = counts.voxels,
            .svo_nodes = counts.svo_nodes,
            .dag_nodes = dag_nodes_,
            .bytes = summary.bytes,
            .sha256 = summary.sha256,
            .pairs = pairs_,
            .work_bytes = scratch_.bytes_written()};
  }

 private:
  uint64_t share(uint64_t divisor) const {
    return std::min(spec_.memory_bytes / divisor, spec_.list_bytes);
  }
  uint32_t level_count() const { return a_.file().brick_level() + 1; }

  // Returns the facts about all levels, from the root to the bricks.
  std::vector<std::unique_ptr<JoinedLevel>> join() {
    std::vector<std::unique_ptr<JoinedLevel>> joined(level_count());
    progress_.begin_stage("join", a_.file().dag_nodes() + b_.file().dag_nodes(), "nodes");
    Join join(a_, b_, space_, memory_);
    for (uint32_t level = level_count(); level-- > 0;) {
      joined[level] = std::make_unique<JoinedLevel>(space_);
      join.add_level(level, *joined[level]);
      progress_.advance(a_.level(level).node_count + b_.level(level).node_count);
    }
    progress_.end_stage();
    return joined;
  }

  VoxelCounts write_levels(GlobalFileWriter& out) {
    const auto joined = join();
    BrickResults bricks(space_);
    const Outcome reference =
        reference_of(spec_.operation, a_.file().dag_nodes(), b_.file().dag_nodes());
    PairLevels pair_levels(a_, b_, spec_.operation, reference, joined, space_);
    const auto pairs = pair_levels.descend(bricks);
    pairs_ = pair_levels.pair_count();
    progress_.begin_stage("merge", level_count(), "levels");
    CountLevels counts(a_, b_, reference, bricks.counts, space_, memory_);
    LevelsWriter writer(a_, b_, space_, memory_, counts, out);
    writer.write_level(level_count() - 1, *joined.back(), *pairs.back(), bricks.rows);
    progress_.advance(1);
    for (uint32_t level = level_count() - 1; level-- > 0 && writer.dag_nodes() > 0;) {
      SpillSorter<PairRow> rows(space_);
      writer.write_level(level, *joined[level], *pairs[level], rows);
      progress_.advance(1);
    }
    progress_.end_stage();
    dag_nodes_ = writer.dag_nodes();
    if (dag_nodes_ == 0) return {};
    const OctreeCounts total = counts.total();
    return {.voxels = total.voxels, .svo_nodes = total.nodes};
  }

  const CombineSpec& spec_;
  FileSystem& files_;
  Progress& progress_;
  const CancelToken& cancel_;
  DagInput a_;
  DagInput b_;
  MemoryBudget budget_;
  const TemporaryWork work_;
  ScratchFolder scratch_;
  const SpillSpace space_;
  const LookupMemory memory_;
  uint64_t pairs_ = 0;
  uint64_t dag_nodes_ = 0;
};

}  // namespace

CombineReport combine(const voxdag_reader::File& a, const voxdag_reader::File& b,
                      const CombineSpec& spec, FileSystem& files, Progress& progress,
                      const CancelToken& cancel) {
  refuse_unequal(a, b);
  LockedOutputs outputs(files, {{spec.output}, {a.path(), b.path()}, spec.replace});
  const WatchedFile watched_a(a), watched_b(b);
  const auto run = [&] {
    return Combination(a, b, spec, outputs.files(), progress, cancel).run([&] {
      watched_a.check_readable();
      watched_b.check_readable();
    });
  };
  return watched_a.run([&] { return watched_b.run([&] { return with_reader_errors(run); }); });
}

}  // namespace voxdag::query
