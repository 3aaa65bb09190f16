#include "query/extract/extract.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "core/base/text.h"
#include "core/dag/consing/consing_memory.h"
#include "core/format/artifact/artifact_writer.h"
#include "core/format/artifact/segment_writer.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "core/geometry/octree_descent.h"
#include "core/io/outputs/temporary_work.h"
#include "merge/merge.h"
#include "query/dag/locked_outputs.h"
#include "query/dag/publish_file.h"
#include "query/dag/refuse_attributes.h"
#include "query/extract/majority_cells.h"
#include "query/extract/node_reader.h"
#include "query/extract/part_builder.h"
#include "query/extract/part_colors.h"

namespace voxdag::query {
namespace {

// Minimum memory share of a worker, enough for any cube of a few bricks. kOutsideShareBytes is the
// memory that a worker needs in addition to its share. It holds the segment being written, words of
// the file, and memory pages that the worker retains for its next cube.
constexpr uint64_t kMinShareBytes = uint64_t{8} << 20;
constexpr uint64_t kOutsideShareBytes =
    kSegmentWriterBytes + NodeReader::kMemoryBytes + ConsingMemory::kMinPageBytes;
constexpr unsigned kMaxWorkers = 256;  // each worker has an open file
// Estimated memory per node while the DAG of a cube is built. The initial number of cubes is
// computed from this estimate.
constexpr uint64_t kBytesPerNode = 128;
// If the levels that are read have at most this number of nodes in total, the complete grid is one
// cube, which one thread builds. This is faster than several threads, because each thread would
// build the subtrees that occur in its cubes again.
constexpr uint64_t kFewNodes = uint64_t{1} << 17;
constexpr uint64_t kPartsPerWorker = 4;
constexpr uint64_t kMaxFirstParts = 4096;

class Extraction {
 public:
  Extraction(const voxdag_reader::File& file, const ExtractSpec& spec, FileSystem& files,
             Progress& progress, const CancelToken& cancel)
      : spec_(spec),
        files_(files),
        progress_(progress),
        cancel_(cancel),
        file_(file),
        crop_(spec.crop ? crop_cube(spec.selection) : Cube{}),
        budget_(spec.memory_bytes),
        work_(files, spec.output + ".work-") {
    report_.grid = new_grid();
    shape_ = {.grid_levels = report_.grid.levels, .hash_bits = file.hash_bits()};
  }

  // Writes the output. Calls before_publish() before the output gets its final name. If
  // before_publish() throws, the output is discarded.
  ExtractReport run(const std::function<void()>& before_publish) {
    const bool is_whole = spec_.selection.region == whole_grid(spec_.selection.grid_levels);
    if (spec_.crop && is_whole)
      warn(option_text("crop") + " has no effect: the region is the complete grid");
    if (spec_.majority && spec_.selection.grid_levels == file_.grid_levels())
      warn(option_text("majority") + " has no effect: the level is not coarser than the file");
    if (spec_.crop && crop_.level == 0 && !is_whole)
      warn(
          "the region has cells on both sides of a plane through the middle of the grid: the "
          "smallest octree cube around it is the complete grid");
    find_majority_cells();
    const MergeInputs inputs = merge_inputs(build_parts());
    GlobalFileWriter out(files_, spec_.output, report_.grid, shape_.hash_bits, spec_.narrow_words);
    const MergeReport merged =
        merge_sub_dags(inputs, files_, out, budget_, spec_.threads, progress_, cancel_);
    report_.voxels = merged.voxels;
    report_.svo_nodes = merged.svo_nodes;
    report_.dag_nodes = merged.dag_nodes;
    report_.merge_passes = merged.passes;
    report_.work_bytes += merged.scratch_bytes;
    if (merged.voxels == 0)
      warn(majority_ ? "no cell of the selection has half of its voxels set: the file "
                       "will have no nodes"
                     : "the selection has no voxels: the file will have no nodes");
    else
      with_reader_errors([&] {
        for (const Attribute attribute : attributes_of(file_).list())
          write_part_attribute({file_, spec_.selection, crop_}, attribute, files_, out, budget_,
                               spec_.threads, progress_, cancel_);
      });
    const GlobalFileSummary summary =
        publish_file(out, {.voxels = merged.voxels, .svo_nodes = merged.svo_nodes}, spec_.threads,
                     before_publish, progress_, cancel_);
    report_.bytes = summary.bytes;
    report_.sha256 = summary.sha256;
    return report_;
  }

 private:
  // Data of one thread, reused for all cubes that the thread builds.
  struct Worker {
    Worker(Extraction& all, unsigned id, uint64_t share_bytes)
        : share(share_bytes, &all.budget_),
          reader(*all.source_, all.budget_, all.cancel_),
          builder(all.file_, all.spec_.selection, all.majority_.get(), reader, {share, pages},
                  all.cancel_),
          segment(all.files_, all.work_.path(), id, all.budget_) {}

    MemoryBudget share;
    PagePool pages;
    NodeReader reader;
    PartBuilder builder;
    SegmentWriter segment;
  };

  Grid new_grid() const {
    Grid grid;
    grid.levels = spec_.selection.grid_levels - crop_.level;
    grid.edge = std::ldexp(file_.edge(), -static_cast<int>(crop_.level));
    for (size_t axis = 0; axis < 3; ++axis)
      grid.origin[axis] = file_.origin()[axis] + crop_.position[axis] * grid.edge;
    return grid;
  }

  // Converts a cube of the whole grid to the coordinates of the new grid.
  Cube in_new_grid(Cube cube) const {
    cube.level -= crop_.level;
    for (int axis = 0; axis < 3; ++axis) cube.position[axis] -= crop_.position[axis] << cube.level;
    return cube;
  }

  void find_majority_cells();
  std::vector<ArtifactRef> build_parts();
  std::vector<SelectedPart> first_parts(Worker& worker, uint64_t wanted) const;
  uint64_t wanted_parts(unsigned workers, uint64_t share_bytes) const;
  std::vector<SelectedPart> build_part(Worker& worker, const SelectedPart& part,
                                       std::vector<ArtifactRef>& built);
  MergeInputs merge_inputs(std::vector<ArtifactRef> artifacts);

  void warn(const std::string& message) {
    progress_.warn(message);
    report_.warnings.push_back(message);
  }

  const ExtractSpec& spec_;
  FileSystem& files_;
  Progress& progress_;
  const CancelToken& cancel_;
  const voxdag_reader::File& file_;
  const Cube crop_;
  DagShape shape_;
  MemoryBudget budget_;
  std::unique_ptr<MajorityCells> majority_;
  std::unique_ptr<CheckedReader> source_;
  TemporaryWork work_;
  std::mutex mutex_;  // guards report_ and the lists of parts and artifacts
  ExtractReport report_;
};

void Extraction::find_majority_cells() {
  if (!spec_.majority || spec_.selection.grid_levels == file_.grid_levels()) return;
  ScratchFolder folder(files_, work_.path() + "/counts");
  with_reader_errors([&] {
    majority_ = std::make_unique<MajorityCells>(file_, spec_.selection.grid_levels, folder, budget_,
                                                progress_, cancel_);
  });
  report_.work_bytes += folder.bytes_written();
}

uint64_t Extraction::wanted_parts(unsigned workers, uint64_t share_bytes) const {
  uint64_t nodes = 0;
  const uint32_t deepest = std::min(spec_.selection.grid_levels - 1, file_.brick_level());
  for (uint32_t l = 0; l <= deepest; ++l) nodes += file_.level(l).node_count;
  if (nodes <= kFewNodes) return 1;
  return std::clamp(nodes / std::max<uint64_t>(share_bytes / kBytesPerNode, 1),
                    workers * kPartsPerWorker, kMaxFirstParts);
}

// Divides the cube of the new grid, level by level, into cubes that intersect the selection's
// region. Stops when there are at least `wanted` such cubes, or when the cubes are bricks.
std::vector<SelectedPart> Extraction::first_parts(Worker& worker, uint64_t wanted) const {
  if (file_.empty()) return {};
  std::vector<SelectedPart> parts{{}};
  for (uint32_t level = 0; level < crop_.level; ++level) {
    const Cube next = ancestor(crop_, level + 1);
    std::vector<SelectedPart> children = worker.builder.split(parts[0]);
    std::erase_if(children, [&](const SelectedPart& child) { return child.cube != next; });
    if (children.empty()) return {};
    parts = std::move(children);
  }
  const uint32_t brick_level = spec_.selection.grid_levels - kBrickLevels;
  while (parts.size() < wanted && !parts.empty() && parts[0].cube.level < brick_level) {
    std::vector<SelectedPart> children;
    for (const SelectedPart& part : parts) {
      cancel_.check();
      for (const SelectedPart& child : worker.builder.split(part)) children.push_back(child);
    }
    parts = std::move(children);
  }
  return parts;
}

// Builds the artifact of a part and adds it to `built`. If the part does not fit in the worker's
// memory, returns its children, which must be built instead.
std::vector<SelectedPart> Extraction::build_part(Worker& worker, const SelectedPart& part,
                                                 std::vector<ArtifactRef>& built) {
  const Cube cube = in_new_grid(part.cube);
  try {
    ArtifactWriter artifact(worker.segment, shape_);
    const SubDagSummary summary =
        worker.builder.build(part, {cube.level, shape_.grid_levels, shape_.hash_bits}, artifact);
    if (summary.empty()) return {};
    const ArtifactRoot root{cube, 0, summary.root_hash, summary.voxels, summary.svo_nodes};
    const ArtifactRef ref = artifact.finish({&root, 1});
    const std::lock_guard lock(mutex_);
    built.push_back(ref);
    ++report_.parts;
    return {};
  } catch (const OutOfBudget&) {
    if (cube.level == shape_.brick_level())
      throw Error(ErrorCode::kOutOfMemory,
                  "a brick does not fit a worker's share of " + size_text(worker.share.limit()) +
                      ": expected more memory (" + option_text("memory") + ")");
    return worker.builder.split(part);
  }
}

std::vector<ArtifactRef> Extraction::build_parts() {
  source_ = std::make_unique<CheckedReader>(files_, file_, budget_);
  const uint64_t free_bytes = budget_.available();
  const unsigned count = static_cast<unsigned>(
      std::clamp<uint64_t>(free_bytes / (kMinShareBytes + kOutsideShareBytes), 1,
                           std::min(std::max(spec_.threads, 1u), kMaxWorkers)));
  const uint64_t share_bytes =
      free_bytes / count - std::min(free_bytes / count, kOutsideShareBytes);
  std::vector<std::unique_ptr<Worker>> workers;
  for (unsigned i = 0; i < count; ++i)
    workers.push_back(std::make_unique<Worker>(*this, i, share_bytes));
  std::vector<ArtifactRef> built;
  std::vector<SelectedPart> parts = first_parts(*workers[0], wanted_parts(count, share_bytes));
  uint64_t total = parts.size();
  progress_.begin_stage("extract", total, "cubes");
  while (!parts.empty()) {
    std::vector<SelectedPart> smaller;
    parallel_for(count, parts.size(), [&](unsigned worker, size_t i) {
      const std::vector<SelectedPart> replaced = build_part(*workers[worker], parts[i], built);
      const std::lock_guard lock(mutex_);
      smaller.insert(smaller.end(), replaced.begin(), replaced.end());
      total += replaced.size();
      if (!replaced.empty()) {
        ++report_.parts_split;
        progress_.set_total(total);
      }
      progress_.advance(1);
    });
    parts = std::move(smaller);
  }
  for (const auto& worker : workers) {
    worker->segment.complete();
    report_.work_bytes += worker->segment.size();
  }
  progress_.end_stage();
  source_.reset();
  return built;
}

MergeInputs Extraction::merge_inputs(std::vector<ArtifactRef> artifacts) {
  MergeInputs inputs;
  inputs.shape = shape_;
  inputs.artifacts = std::move(artifacts);
  const auto segments = std::make_shared<std::map<uint32_t, std::shared_ptr<ReadableFile>>>();
  const auto mutex = std::make_shared<std::mutex>();
  inputs.open_segment = [this, segments, mutex](uint32_t id) {
    const std::lock_guard lock(*mutex);
    std::shared_ptr<ReadableFile>& segment = (*segments)[id];
    if (!segment) segment = files_.open_own(segment_path(work_.path(), id));
    return segment;
  };
  inputs.scratch_folder = work_.path() + "/merge";
  return inputs;
}

}  // namespace

Cube crop_cube(const Selection& selection) {
  const Region& region = selection.region;
  uint32_t up = kBrickLevels;
  for (size_t axis = 0; axis < 3; ++axis)
    while (region.low[axis] >> up != (region.high[axis] - 1) >> up) ++up;
  Cube cube{selection.grid_levels - up, {}};
  for (size_t axis = 0; axis < 3; ++axis)
    cube.position[axis] = static_cast<uint32_t>(region.low[axis] >> up);
  return cube;
}

ExtractReport extract(const voxdag_reader::File& file, const ExtractSpec& spec, FileSystem& files,
                      Progress& progress, const CancelToken& cancel) {
  check_grid(spec.selection, file.grid_levels());
  if (spec.majority) refuse_attributes(file, "which an extract by majority cannot keep");
  LockedOutputs outputs(files, {{spec.output}, {file.path()}, spec.replace});
  const WatchedFile watched(file);  // colors are read from the mapped file
  return watched.run([&] {
    return Extraction(file, spec, outputs.files(), progress, cancel).run([&] {
      watched.check_readable();
    });
  });
}

}  // namespace voxdag::query
