#include "query/combine/combine.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/base/text.h"
#include "core/format/global/diff.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "core/geometry/cube.h"
#include "query/combine/count_levels.h"
#include "query/combine/join.h"
#include "query/combine/level_writer.h"
#include "query/combine/moved.h"
#include "query/combine/pair_levels.h"
#include "query/dag/locked_outputs.h"
#include "query/dag/refuse_attributes.h"
#include "query/dag/refuse_order.h"
#include "query/dag/temporary_work.h"

namespace voxdag::query {
namespace {

// Divisors of the memory limit. The quotients are the memory of one list, one sorter (spill.h), the
// values of one level, and one window of lookups (node_values.h). There are up to nine lists for
// each level, and up to six sorters and four levels of values at any time.
constexpr uint64_t kListShare = 1024;
constexpr uint64_t kSorterShare = 32;
constexpr uint64_t kValueShare = 10;
constexpr uint64_t kWindowShare = 32;
// The hashes of all nodes are in memory if they fit in memory_bytes / kHashShare.
constexpr uint64_t kHashShare = 8;
constexpr uint64_t kListBufferBytes = uint64_t{16} << 10;
constexpr const char* kNoAttributes = "which combine cannot join";

void refuse_unequal(const voxdag_reader::File& a, const voxdag_reader::File& b, bool is_moved) {
  const auto voxel_edge = [](const voxdag_reader::File& file) {
    return file.edge() / static_cast<double>(file.resolution());
  };
  if (!is_moved) expect_same_grid(a, b, "combined");
  if (voxel_edge(a) != voxel_edge(b))
    throw Error(ErrorCode::kInvalidInput,
                "only files with equal voxels can be combined: a voxel of " + a.path() +
                    " has the edge " + number_text(voxel_edge(a)) + "; a voxel of " + b.path() +
                    " has the edge " + number_text(voxel_edge(b)));
  if (a.hash_bits() != b.hash_bits())
    throw Error(ErrorCode::kInvalidInput,
                "only files with equal hash bits can be combined: " + a.path() + " has " +
                    std::to_string(a.hash_bits()) + "; " + b.path() + " has " +
                    std::to_string(b.hash_bits()));
  refuse_attributes(b, kNoAttributes);
  refuse_other_order(a);
  if (!is_moved) refuse_other_order(b);  // move_file() sorts the nodes by hash
}

// The temporary folder of one combine() or cut(), its memory budget, and the budget's shares.
struct Workspace {
  Workspace(const CombineSpec& combine_spec, FileSystem& file_system)
      : spec(combine_spec),
        files(file_system),
        budget(spec.memory_bytes),
        folder(files, spec.output + ".work-"),
        scratch(files, folder.path()),
        space{scratch, budget, share(kListShare), share(kSorterShare),
              std::min(spec.list_bytes, kListBufferBytes)},
        memory{share(kValueShare), share(kWindowShare)} {}
  uint64_t share(uint64_t divisor) const {
    return std::min(spec.memory_bytes / divisor, spec.list_bytes);
  }

  const CombineSpec& spec;
  FileSystem& files;
  MemoryBudget budget;
  const TemporaryWork folder;
  ScratchFolder scratch;
  const SpillSpace space;
  const LookupMemory memory;
};

// The data from which write_levels() makes a new file. `joined` has the results of Join (join.h),
// and `pairs` has the pairs and kept nodes (pair_levels.h); both have one element per level, and
// index 0 is the root's level. `bricks` has the results of the pairs of bricks. `reference` is the
// reference file (reference_of() in operation.h).
struct NewLevels {
  explicit NewLevels(const SpillSpace& space) : bricks(space) {}
  std::vector<std::unique_ptr<JoinedLevel>> joined;
  std::vector<std::unique_ptr<PairLevel>> pairs;
  BrickResults bricks;
  Outcome reference = Outcome::kEmpty;
};

struct NewCounts {
  VoxelCounts octree;
  uint64_t dag_nodes = 0;
};

// Writes the levels of a new file from `levels`, from the bricks up. Returns the numbers of voxels
// and nodes. The new file has the resolution of `a`.
NewCounts write_levels(DagInput& a, DagInput& b, NewLevels& levels, const Workspace& work,
                       GlobalFileWriter& out, Progress& progress) {
  const size_t count = levels.pairs.size();
  progress.begin_stage("merge", count, "levels");
  CountLevels counts(a, b, levels.reference, levels.bricks.counts, work.space, work.memory);
  LevelsWriter writer(a, b, work.space, work.memory, counts, out);
  writer.write_level(static_cast<uint32_t>(count - 1), *levels.joined.back(), *levels.pairs.back(),
                     levels.bricks.rows);
  progress.advance(1);
  for (size_t level = count - 1; level-- > 0 && writer.dag_nodes() > 0;) {
    SpillSorter<PairRow> rows(work.space);
    writer.write_level(static_cast<uint32_t>(level), *levels.joined[level], *levels.pairs[level],
                       rows);
    progress.advance(1);
  }
  progress.end_stage();
  if (writer.dag_nodes() == 0) return {};
  const OctreeCounts total = counts.total();
  return {{.voxels = total.voxels, .svo_nodes = total.nodes}, writer.dag_nodes()};
}

class Combination {
 public:
  // If `shape` is not null, the shape is subtracted from `a`; `b` must then be a file without
  // nodes.
  Combination(const voxdag_reader::File& a, const voxdag_reader::File& b, const Shape* shape,
              Workspace& work, Progress& progress, const CancelToken& cancel)
      : work_(work),
        shape_(shape),
        progress_(progress),
        cancel_(cancel),
        a_(a, work.spec.memory_bytes, cancel),
        b_(b, work.spec.memory_bytes, cancel),
        hash_space_(work.space) {
    const uint64_t bytes = sizeof(uint64_t) * (a.dag_nodes() + b.dag_nodes());
    if (bytes <= work.share(kHashShare)) hash_space_.list_bytes = bytes;
  }

  // Writes the output. Calls before_publish() just before the output gets its final name. If
  // before_publish() throws, the output is discarded.
  CombineReport run(const std::function<void()>& before_publish) {
    GlobalFileWriter out(work_.files, work_.spec.output, grid_of(a_.file()), a_.file().hash_bits(),
                         work_.spec.narrow_words);
    NewLevels levels(work_.space);
    const uint64_t pairs = find_levels(levels);
    const NewCounts counts = write_levels(a_, b_, levels, work_, out, progress_);
    if (counts.octree.voxels == 0)
      progress_.warn("the result has no voxels: the file will have no nodes");
    progress_.begin_stage("write", 1, "files");
    const GlobalFileSummary summary = out.seal(counts.octree, work_.spec.threads, cancel_);
    before_publish();
    out.publish();
    progress_.advance(1);
    progress_.end_stage();
    return {.grid = grid_of(a_.file()),
            .voxels = counts.octree.voxels,
            .svo_nodes = counts.octree.svo_nodes,
            .dag_nodes = counts.dag_nodes,
            .bytes = summary.bytes,
            .sha256 = summary.sha256,
            .pairs = pairs,
            .work_bytes = work_.scratch.bytes_written()};
  }

 private:
  uint32_t level_count() const { return a_.file().brick_level() + 1; }

  // Joins every level of the two files (join.h), from the bricks up. For each level, returns the
  // hashes of both files' nodes, the pairs of equal nodes, and the nodes in which all voxels are
  // set. Index 0 is the root's level.
  std::vector<std::unique_ptr<JoinedLevel>> join() {
    std::vector<std::unique_ptr<JoinedLevel>> joined(level_count());
    progress_.begin_stage("join", a_.file().dag_nodes() + b_.file().dag_nodes(), "nodes");
    Join join(a_, b_, work_.space, work_.memory);
    for (uint32_t level = level_count(); level-- > 0;) {
      joined[level] = std::make_unique<JoinedLevel>(work_.space, hash_space_);
      join.add_level(level, *joined[level]);
      progress_.advance(a_.level(level).node_count + b_.level(level).node_count);
    }
    progress_.end_stage();
    return joined;
  }

  // Returns the number of pairs.
  uint64_t find_levels(NewLevels& levels) {
    const Operation operation = shape_ ? Operation::kMinus : work_.spec.operation;
    levels.reference = reference_of(operation, a_.file().dag_nodes(), b_.file().dag_nodes());
    levels.joined = join();
    if (shape_)
      for (const auto& level : levels.joined) level->full.b = Shape::kFull;
    PairLevels pair_levels(a_, b_, shape_, operation, levels.reference, levels.joined, work_.space);
    levels.pairs = pair_levels.descend(levels.bricks);
    return pair_levels.pair_count();
  }

  Workspace& work_;
  const Shape* const shape_;
  Progress& progress_;
  const CancelToken& cancel_;
  DagInput a_;
  DagInput b_;
  SpillSpace hash_space_;
};

// Writes the second file, moved by work.spec.offset into the grid of the first file, to a temporary
// file. Returns this file, opened.
std::unique_ptr<voxdag_reader::File> move_file(const voxdag_reader::File& a,
                                               const voxdag_reader::File& b, Workspace& work,
                                               Progress& progress, const CancelToken& cancel) {
  // Limits the offset to prevent overflow. With an offset of kFar, all voxels of `b` are already
  // outside the grid of `a`.
  constexpr int64_t kFar = int64_t{1} << (kMaxGridLevels + 1);
  std::array<int64_t, 3> offset = *work.spec.offset;
  for (int64_t& distance : offset) distance = std::clamp(distance, -kFar, kFar);
  DagInput target(a, work.spec.memory_bytes, cancel), input(b, work.spec.memory_bytes, cancel);
  const std::string path = work.folder.path() + "/moved.vdag";
  GlobalFileWriter out(work.files, path, grid_of(a), a.hash_bits(), work.spec.narrow_words);
  NewLevels levels(work.space);
  levels.pairs =
      MovedLevels(input, a.grid_levels(), offset, a.hash_bits(), work.space).descend(levels.bricks);
  for (size_t i = 0; i < levels.pairs.size(); ++i)
    levels.joined.push_back(std::make_unique<JoinedLevel>(work.space, work.space));
  out.finish(write_levels(target, target, levels, work, out, progress).octree);
  return open_global_file(path);
}

// Writes a temporary file with the grid of `a` but without nodes. Returns this file, opened.
std::unique_ptr<voxdag_reader::File> empty_file(const voxdag_reader::File& a, Workspace& work) {
  const std::string path = work.folder.path() + "/empty.vdag";
  GlobalFileWriter out(work.files, path, grid_of(a), a.hash_bits(), work.spec.narrow_words);
  out.finish({});
  return open_global_file(path);
}

CombineReport combine_moved(const voxdag_reader::File& a, const voxdag_reader::File& b,
                            Workspace& work, Progress& progress, const CancelToken& cancel,
                            const std::function<void()>& before_publish) {
  const auto moved = move_file(a, b, work, progress, cancel);
  const uint64_t clipped = b.voxels() - moved->voxels();
  if (clipped > 0 && !work.spec.clip)
    throw Error(ErrorCode::kInvalidInput,
                b.path() + ": " + std::to_string(clipped) + " of its " +
                    std::to_string(b.voxels()) + " voxels would be outside of the grid of " +
                    a.path() + ": expected another offset, or --clip to drop them");
  CombineReport report =
      Combination(a, *moved, nullptr, work, progress, cancel).run(before_publish);
  report.clipped = clipped;
  return report;
}

}  // namespace

CombineReport combine(const voxdag_reader::File& a, const voxdag_reader::File& b,
                      const CombineSpec& spec, FileSystem& files, Progress& progress,
                      const CancelToken& cancel) {
  refuse_attributes(a, kNoAttributes);
  refuse_unequal(a, b, spec.offset.has_value());
  LockedOutputs outputs(files, {{spec.output}, {a.path(), b.path()}, spec.replace});
  const WatchedFile watched_a(a), watched_b(b);
  const auto check_readable = [&] {
    watched_a.check_readable();
    watched_b.check_readable();
  };
  const auto run = [&] {
    Workspace work(spec, outputs.files());
    if (spec.offset) return combine_moved(a, b, work, progress, cancel, check_readable);
    return Combination(a, b, nullptr, work, progress, cancel).run(check_readable);
  };
  return watched_a.run([&] { return watched_b.run([&] { return with_reader_errors(run); }); });
}

CombineReport cut(const voxdag_reader::File& a, const Shape& shape, const CombineSpec& spec,
                  FileSystem& files, Progress& progress, const CancelToken& cancel) {
  refuse_attributes(a, kNoAttributes);
  refuse_other_order(a);
  LockedOutputs outputs(files, {{spec.output}, {a.path()}, spec.replace});
  const WatchedFile watched(a);
  const auto run = [&] {
    Workspace work(spec, outputs.files());
    const auto empty = empty_file(a, work);
    return Combination(a, *empty, &shape, work, progress, cancel).run([&] {
      watched.check_readable();
    });
  };
  return watched.run([&] { return with_reader_errors(run); });
}

}  // namespace voxdag::query
