#include "query/combine/combine.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/format/global/diff.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "core/geometry/cube.h"
#include "query/attributes/color_levels.h"
#include "query/attributes/combined_section.h"
#include "query/combine/moved.h"
#include "query/combine/new_file.h"
#include "query/dag/locked_outputs.h"
#include "query/dag/refuse_order.h"

namespace voxdag::query {
namespace {

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
    const uint64_t nodes = a.dag_nodes() + b.dag_nodes();
    if (work.has_room_for_hashes(nodes)) hash_space_.list_bytes = sizeof(uint64_t) * nodes;
  }

  // Writes the output. Calls before_publish() just before the output gets its final name. If
  // before_publish() throws, the output is discarded.
  CombineReport run(const std::function<void()>& before_publish) {
    const auto write_attributes = [&](const voxdag_reader::File& result, GlobalFileWriter& out) {
      const CombinedFiles from{
          result,           a_.file(),         attributes_.b, b_.file(), attributes_.offset,
          attributes_.fill, attributes_.levels};
      for (const CombinedAttribute& attribute : attributes_.attributes)
        write_combined_attribute(from, attribute, work_.files, out, work_.budget,
                                 work_.spec.threads, progress_, cancel_);
    };
    NewFile file(a_.file(), work_, progress_, cancel_);
    return file.write(
        [&](GlobalFileWriter& out) { return write_voxels(out); },
        attributes_.attributes.empty() ? NewFile::WriteAttributes() : write_attributes,
        before_publish);
  }

 private:
  // Writes the levels of the new file. Returns a report with the numbers of voxels, nodes and
  // pairs.
  CombineReport write_voxels(GlobalFileWriter& out) {
    NewLevels levels(work_.space);
    const uint64_t pairs = find_levels(levels);
    const NewCounts counts = write_levels(a_, b_, levels, work_, out, progress_);
    // From here on, only a file whose attributes are used is read.
    a_.file().release_pages();
    b_.file().release_pages();
    attributes_.b.release_pages();
    CombineReport report;
    report.voxels = counts.octree.voxels;
    report.svo_nodes = counts.octree.svo_nodes;
    report.dag_nodes = counts.dag_nodes;
    report.pairs = pairs;
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
    join.finish();
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
  if (spec.color_resolution > 0 && inputs.attributes.empty())
    progress.warn(unused_color_resolution());
  inputs.levels =
      color_levels_of(a, first.name, b, inputs.attributes, spec.color_resolution, progress);
  return inputs;
}

}  // namespace

CombineReport combine(const voxdag_reader::File& a, const voxdag_reader::File& b,
                      const CombineSpec& spec, FileSystem& files, Progress& progress,
                      const CancelToken& cancel) {
  check_attribute_options(spec.attributes, spec.fill_color.has_value(), spec.color_resolution);
  if (spec.clip && !spec.offset)
    throw Error(
        ErrorCode::kInvalidInput,
        option_text("clip") + " was given without a move: expected " + option_text("offset"));
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
