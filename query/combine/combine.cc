#include "query/combine/combine.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/format/global/diff.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "core/geometry/cube.h"
#include "core/io/outputs/temporary_work.h"
#include "query/attributes/color_levels.h"
#include "query/attributes/combined_section.h"
#include "query/combine/count_levels.h"
#include "query/combine/join.h"
#include "query/combine/level_writer.h"
#include "query/combine/moved.h"
#include "query/combine/pair_levels.h"
#include "query/dag/locked_outputs.h"
#include "query/dag/publish_file.h"
#include "query/dag/refuse_order.h"

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

void refuse_unequal(const FirstFile& first, const voxdag_reader::File& b, bool is_moved) {
  const voxdag_reader::File& a = first.grid;
  const auto voxel_edge = [](const voxdag_reader::File& file) {
    return file.edge() / static_cast<double>(file.resolution());
  };
  if (!is_moved) expect_same_grid(a, b, "combined");
  if (voxel_edge(a) != voxel_edge(b))
    throw Error(ErrorCode::kInvalidInput,
                "only files with equal voxels can be combined: a voxel of " + first.name +
                    " has the edge " + number_text(voxel_edge(a)) + "; a voxel of " + b.path() +
                    " has the edge " + number_text(voxel_edge(b)));
  if (a.hash_bits() != b.hash_bits())
    throw Error(ErrorCode::kInvalidInput,
                "only files with equal hash bits can be combined: " + first.name + " has " +
                    std::to_string(a.hash_bits()) + "; " + b.path() + " has " +
                    std::to_string(b.hash_bits()));
  refuse_other_order(a);
  if (!is_moved) refuse_other_order(b);  // move_file() sorts the nodes by hash
}

// Returns the attributes of the result in the order of their sections: for kMinus, A's attributes;
// for kAnd, the attributes of A or B; for kUnion and kXor, the attributes that both files have. A
// file without voxels counts as a file with all attributes. Throws Error{kInvalidInput} for kUnion
// and kXor if only one file has an attribute, except for colors if `can_fill` is true.
std::vector<CombinedAttribute> combined_attributes(const FirstFile& a, const voxdag_reader::File& b,
                                                   Operation operation, bool can_fill) {
  std::vector<CombinedAttribute> combined;
  const AttributeSet in_b = attributes_of(b);
  for (const AttributeTraits& row : kAttributeTable) {
    const bool has_a = a.attributes.has(row.attribute), has_b = in_b.has(row.attribute);
    if (!has_a && !has_b) continue;
    if (operation == Operation::kMinus) {
      if (has_a) combined.push_back({row.attribute, true, false});
      continue;
    }
    if (operation == Operation::kAnd) {
      combined.push_back({row.attribute, has_a, !has_a});
      continue;
    }
    const std::string &owner = has_a ? a.name : b.path(), &other = has_a ? b.path() : a.name;
    const bool is_other_empty = has_a ? b.empty() : a.is_empty;
    const bool is_complete = has_a == has_b || is_other_empty || (row.is_color() && can_fill);
    if (!is_complete)
      throw Error(
          ErrorCode::kInvalidInput,
          owner + " has " + row.plural + " and " + other + " has none: expected " + row.plural +
              " in both files, " +
              (row.is_color() ? option_text("fill_color") + " with a color for " + other + ", "
                              : std::string()) +
              "or " + option_text("no_attributes") + " to combine only the voxels");
    combined.push_back({row.attribute, has_a, has_b});
  }
  return combined;
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

// Copies the levels of `from` to `out`.
void copy_levels(DagInput& from, GlobalFileWriter& out) {
  constexpr uint64_t kChunkWords = uint64_t{1} << 16;
  for (uint32_t level = from.file().brick_level() + 1; level-- > 0;) {
    const voxdag_reader::Level& words = from.level(level);
    out.begin_level(level);
    for (uint64_t first = 0; first < words.word_count; first += kChunkWords) {
      const auto chunk = from.words(level, first, std::min(kChunkWords, words.word_count - first));
      out.checksum_words(chunk);
      out.write_words(first, chunk);
    }
    out.end_level({words.node_count, words.word_count});
  }
}

// Attributes of a new file. `b` is the second file as it was given, and `offset` the place of its
// voxel (0, 0, 0) in the grid of the first file.
struct AttributeInputs {
  std::vector<CombinedAttribute> attributes;
  const voxdag_reader::File& b;
  std::array<int64_t, 3> offset = {};
  std::optional<voxdag_reader::Rgb> fill = {};  // set only if cells need it
  uint32_t levels = 0;                          // level of the finest cells
};

class Combination {
 public:
  // If `shape` is not null, the shape is subtracted from `a`; `b` must then be a file without
  // nodes.
  Combination(const voxdag_reader::File& a, const voxdag_reader::File& b, const Shape* shape,
              const AttributeInputs& attributes, Workspace& work, Progress& progress,
              const CancelToken& cancel)
      : work_(work),
        shape_(shape),
        attributes_(attributes),
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
    GlobalFileWriter out = writer(work_.spec.output);
    CombineReport report = attributes_.attributes.empty() ? write_voxels(out) : write_all(out);
    if (report.voxels == 0) progress_.warn("the result has no voxels: the file will have no nodes");
    report.grid = grid_of(a_.file());
    finish(out, {.voxels = report.voxels, .svo_nodes = report.svo_nodes}, before_publish, report);
    report.work_bytes += work_.scratch.bytes_written();
    return report;
  }

 private:
  GlobalFileWriter writer(const std::string& path) const {
    return GlobalFileWriter(work_.files, path, grid_of(a_.file()), a_.file().hash_bits(),
                            work_.spec.narrow_words);
  }
  void finish(GlobalFileWriter& out, const VoxelCounts& counts,
              const std::function<void()>& before_publish, CombineReport& report) {
    if (work_.spec.temporary) {
      before_publish();
      report.bytes = out.finish_temporary(counts);
      return;
    }
    const GlobalFileSummary summary =
        publish_file(out, counts, work_.spec.threads, before_publish, progress_, cancel_);
    report.bytes = summary.bytes;
    report.sha256 = summary.sha256;
  }
  // Writes the levels of the new file. Returns a report with the numbers of voxels, nodes and
  // pairs.
  CombineReport write_voxels(GlobalFileWriter& out) {
    NewLevels levels(work_.space);
    const uint64_t pairs = find_levels(levels);
    const NewCounts counts = write_levels(a_, b_, levels, work_, out, progress_);
    CombineReport report;
    report.voxels = counts.octree.voxels;
    report.svo_nodes = counts.octree.svo_nodes;
    report.dag_nodes = counts.dag_nodes;
    report.pairs = pairs;
    return report;
  }
  // Writes the levels and the attributes of the new file. The levels are written to a temporary
  // file first, because the attributes follow from the set cells of the result.
  CombineReport write_all(GlobalFileWriter& out) {
    const std::string path = work_.folder.path() + "/levels.vdag";
    GlobalFileWriter levels = writer(path);
    CombineReport report = write_voxels(levels);
    if (report.voxels == 0) return report;
    // From here on, only a file whose attributes are used is read.
    a_.file().release_pages();
    b_.file().release_pages();
    attributes_.b.release_pages();
    cancel_.check();
    report.work_bytes =
        levels.finish_temporary({.voxels = report.voxels, .svo_nodes = report.svo_nodes});
    const auto result = open_global_file(path);
    const WatchedFile watched(*result);
    watched.run([&] {
      DagInput input(*result, work_.spec.memory_bytes, cancel_);
      copy_levels(input, out);
      const CombinedFiles from{*result,           a_.file(),          attributes_.b,
                               b_.file(),         attributes_.offset, attributes_.fill,
                               attributes_.levels};
      for (const CombinedAttribute& attribute : attributes_.attributes)
        write_combined_attribute(from, attribute, work_.files, out, work_.budget,
                                 work_.spec.threads, progress_, cancel_);
      watched.check_readable();
    });
    return report;
  }

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
  const AttributeInputs& attributes_;
  Progress& progress_;
  const CancelToken& cancel_;
  DagInput a_;
  DagInput b_;
  SpillSpace hash_space_;
};

// Writes the second file, moved by moved.offset into the grid of the first file, to a temporary
// file. Returns this file, opened.
std::unique_ptr<voxdag_reader::File> move_file(const voxdag_reader::File& a,
                                               const AttributeInputs& moved, Workspace& work,
                                               Progress& progress, const CancelToken& cancel) {
  DagInput target(a, work.spec.memory_bytes, cancel),
      input(moved.b, work.spec.memory_bytes, cancel);
  const std::string path = work.folder.path() + "/moved.vdag";
  GlobalFileWriter out(work.files, path, grid_of(a), a.hash_bits(), work.spec.narrow_words);
  NewLevels levels(work.space);
  levels.pairs = MovedLevels(input, a.grid_levels(), moved.offset, a.hash_bits(), work.space)
                     .descend(levels.bricks);
  for (size_t i = 0; i < levels.pairs.size(); ++i)
    levels.joined.push_back(std::make_unique<JoinedLevel>(work.space, work.space));
  const VoxelCounts counts = write_levels(target, target, levels, work, out, progress).octree;
  cancel.check();
  out.finish_temporary(counts);
  return open_global_file(path);
}

// Writes a temporary file with the grid of `a` but without nodes. Returns this file, opened.
std::unique_ptr<voxdag_reader::File> empty_file(const voxdag_reader::File& a, Workspace& work) {
  const std::string path = work.folder.path() + "/empty.vdag";
  GlobalFileWriter out(work.files, path, grid_of(a), a.hash_bits(), work.spec.narrow_words);
  out.finish_temporary({});
  return open_global_file(path);
}

FirstFile first_file(const voxdag_reader::File& a, const CombineSpec& spec) {
  return {a, spec.first_name.empty() ? a.path() : spec.first_name, attributes_of(a), a.empty()};
}

[[noreturn]] void refuse_outside(const voxdag_reader::File& b, const std::string& a,
                                 const std::string& voxels) {
  throw Error(ErrorCode::kInvalidInput,
              b.path() + ": " + voxels + " would be outside of the grid of " + a +
                  ": expected another offset, or " + option_text("clip") + " to drop them");
}

CombineReport combine_moved(const voxdag_reader::File& a, const AttributeInputs& attributes,
                            Workspace& work, Progress& progress, const CancelToken& cancel,
                            const std::function<void()>& before_publish) {
  const voxdag_reader::File& b = attributes.b;
  const auto moved = move_file(a, attributes, work, progress, cancel);
  const uint64_t clipped = b.voxels() - moved->voxels();
  if (clipped > 0 && !work.spec.clip)
    refuse_outside(b, first_file(a, work.spec).name,
                   std::to_string(clipped) + " of its " + std::to_string(b.voxels()) + " voxels");
  CombineReport report =
      Combination(a, *moved, nullptr, attributes, work, progress, cancel).run(before_publish);
  report.clipped = clipped;
  return report;
}

// Limits the offset to prevent overflow. With an offset of kFar, all voxels of the second file are
// already outside the grid of the first file.
std::array<int64_t, 3> limited(std::array<int64_t, 3> offset) {
  constexpr int64_t kFar = int64_t{1} << (kMaxGridLevels + 1);
  for (int64_t& distance : offset) distance = std::clamp(distance, -kFar, kFar);
  return offset;
}

}  // namespace

AttributeSet check_combinable(const FirstFile& a, const voxdag_reader::File& b,
                              const CombineSpec& spec) {
  refuse_unequal(a, b, spec.offset.has_value());
  refuse_color_resolution(a.grid, spec.color_resolution);
  if (spec.offset && !spec.clip &&
      has_voxels_outside(b, limited(*spec.offset), a.grid.resolution()))
    refuse_outside(b, a.name, "some of its voxels");
  AttributeSet attributes;
  if (spec.attributes)
    for (const CombinedAttribute& combined :
         combined_attributes(a, b, spec.operation, spec.fill_color.has_value()))
      attributes.add(combined.attribute);
  return attributes;
}

bool needs_fill_color(const FirstFile& a, const voxdag_reader::File& b, const CombineSpec& spec) {
  const bool is_union = spec.operation == Operation::kUnion || spec.operation == Operation::kXor;
  const bool has_a = a.attributes.has(Attribute::kColor),
             has_b = attributes_of(b).has(Attribute::kColor);
  return spec.attributes && is_union && has_a != has_b && !(has_a ? b.empty() : a.is_empty);
}

namespace {

// Checks the files, and chooses the attributes of the result. Warns if spec.fill_color is not used.
AttributeInputs attribute_inputs(const voxdag_reader::File& a, const voxdag_reader::File& b,
                                 const CombineSpec& spec, Progress& progress) {
  const FirstFile first = first_file(a, spec);
  check_combinable(first, b, spec);
  AttributeInputs inputs{{}, b, limited(spec.offset.value_or(std::array<int64_t, 3>{}))};
  if (needs_fill_color(first, b, spec))
    inputs.fill = spec.fill_color;
  else if (spec.fill_color)
    progress.warn(option_text("fill_color") +
                  " has no effect: it is used by a union or a symmetric difference if exactly one "
                  "of the files has colors");
  if (!spec.attributes) return inputs;
  inputs.attributes = combined_attributes(first, b, spec.operation, spec.fill_color.has_value());
  inputs.levels =
      color_levels_of(a, first.name, b, inputs.attributes, spec.color_resolution, progress);
  return inputs;
}

}  // namespace

CombineReport combine(const voxdag_reader::File& a, const voxdag_reader::File& b,
                      const CombineSpec& spec, FileSystem& files, Progress& progress,
                      const CancelToken& cancel) {
  const WatchedFile watched_a(a), watched_b(b);
  const auto check_readable = [&] {
    watched_a.check_readable();
    watched_b.check_readable();
  };
  const auto run = [&] {
    const AttributeInputs attributes = attribute_inputs(a, b, spec, progress);
    LockedOutputs outputs(files, {{spec.output}, {a.path(), b.path()}, spec.replace});
    Workspace work(spec, outputs.files());
    if (spec.offset) return combine_moved(a, attributes, work, progress, cancel, check_readable);
    return Combination(a, b, nullptr, attributes, work, progress, cancel).run(check_readable);
  };
  return watched_a.run([&] { return watched_b.run([&] { return with_reader_errors(run); }); });
}

CombineReport cut(const voxdag_reader::File& a, const Shape& shape, const CombineSpec& spec,
                  FileSystem& files, Progress& progress, const CancelToken& cancel) {
  refuse_other_order(a);
  refuse_color_resolution(a, spec.color_resolution);
  LockedOutputs outputs(files, {{spec.output}, {a.path()}, spec.replace});
  const WatchedFile watched(a);
  const auto run = [&] {
    Workspace work(spec, outputs.files());
    const auto empty = empty_file(a, work);
    AttributeInputs attributes{{}, *empty};
    if (spec.attributes) {
      attributes.attributes =
          combined_attributes(first_file(a, spec), *empty, Operation::kMinus, false);
      attributes.levels = color_levels_of(a, first_file(a, spec).name, *empty,
                                          attributes.attributes, spec.color_resolution, progress);
    }
    return Combination(a, *empty, &shape, attributes, work, progress, cancel).run([&] {
      watched.check_readable();
    });
  };
  return watched.run([&] { return with_reader_errors(run); });
}

}  // namespace voxdag::query
