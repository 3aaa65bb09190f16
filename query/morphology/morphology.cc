#include "query/morphology/morphology.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/attributes/color_levels.h"
#include "query/attributes/combined_section.h"
#include "query/combine/new_file.h"
#include "query/dag/locked_outputs.h"
#include "query/morphology/neighbor_levels.h"
#include "query/morphology/steps.h"

namespace voxdag::query {
namespace {

// Applies the steps in turn. Each step except the last one writes a temporary file, which the next
// step reads.
class Steps {
 public:
  Steps(const voxdag_reader::File& a, const Morphology& morphology, Workspace& work,
        Progress& progress, const CancelToken& cancel)
      : a_(a),
        // A cube with N = R already contains the complete grid of R voxels per edge.
        steps_(
            morphology_steps(morphology.is_erosion, morphology.is_outside_set,
                             std::min(morphology.voxels, static_cast<uint64_t>(a.resolution())))),
        stage_(morphology.is_erosion ? "erode" : "dilate"),
        work_(work),
        progress_(progress),
        cancel_(cancel) {}

  // Writes the levels of the result. Returns a report with the numbers of voxels, nodes and groups.
  CombineReport write(GlobalFileWriter& out) {
    uint64_t bytes = 0;
    std::unique_ptr<voxdag_reader::File> current;
    for (size_t i = 0; i + 1 < steps_.size(); ++i) {
      const std::string path = work_.folder.path() + "/step" + std::to_string(i) + ".vdag";
      GlobalFileWriter next(work_.files, path, grid_of(a_), a_.hash_bits(),
                            work_.spec.narrow_words);
      const NewCounts counts = write_step(current ? *current : a_, steps_[i], next);
      cancel_.check();
      bytes += next.finish_temporary(counts.octree);
      const std::unique_ptr<voxdag_reader::File> done =
          std::exchange(current, open_global_file(path));
      if (done) work_.files.remove(done->path());
    }
    const NewCounts counts = write_step(current ? *current : a_, steps_.back(), out);
    a_.release_pages();
    CombineReport report;
    report.voxels = counts.octree.voxels;
    report.svo_nodes = counts.octree.svo_nodes;
    report.dag_nodes = counts.dag_nodes;
    report.pairs = groups_;
    report.work_bytes = bytes;
    return report;
  }

 private:
  NewCounts write_step(const voxdag_reader::File& from, const MorphologyStep& step,
                       GlobalFileWriter& out) {
    DagInput input(from, work_.spec.memory_bytes, cancel_);
    NewLevels levels(work_.space);
    progress_.begin_stage(stage_, from.brick_level() + 1, "levels");
    NeighborLevels neighbors(input, step, work_.space);
    levels.pairs = neighbors.descend(levels.bricks, progress_);
    progress_.end_stage();
    groups_ += neighbors.group_count();
    for (size_t i = 0; i < levels.pairs.size(); ++i)
      levels.joined.push_back(std::make_unique<JoinedLevel>(work_.space, work_.space));
    return write_levels(input, input, levels, work_, out, progress_);
  }

  const voxdag_reader::File& a_;
  const std::vector<MorphologyStep> steps_;
  const char* const stage_;
  Workspace& work_;
  Progress& progress_;
  const CancelToken& cancel_;
  uint64_t groups_ = 0;
};

}  // namespace

CombineReport change_by_cube(const voxdag_reader::File& a, const Morphology& morphology,
                             const CombineSpec& spec, FileSystem& files, Progress& progress,
                             const CancelToken& cancel) {
  refuse_color_resolution(a, spec.color_resolution);
  LockedOutputs outputs(files, {{spec.output}, {a.path()}, spec.replace});
  const WatchedFile watched(a);
  const auto run = [&] {
    Workspace work(spec, outputs.files());
    std::vector<CombinedAttribute> attributes;
    if (spec.attributes)
      for (const Attribute attribute : attributes_of(a).list())
        attributes.push_back({attribute, true, false});
    const std::string& name = spec.first_name.empty() ? a.path() : spec.first_name;
    const uint32_t levels = attributes.empty() ? 0
                                               : color_levels_of(a, name, a, attributes,
                                                                 spec.color_resolution, progress);
    const auto write_attributes = [&](const voxdag_reader::File& result, GlobalFileWriter& out) {
      const CombinedFiles from{
          .result = result,
          .a = a,
          .b = a,
          .moved_b = a,
          .levels = levels,
          .nearest_reach = morphology.is_erosion
                               ? 0
                               : static_cast<uint32_t>(
                                     std::min(morphology.voxels, uint64_t{1} << kMaxGridLevels))};
      for (const CombinedAttribute& attribute : attributes)
        write_combined_attribute(from, attribute, work.files, out, work.budget, spec.threads,
                                 progress, cancel);
    };
    Steps steps(a, morphology, work, progress, cancel);
    return NewFile(a, work, progress, cancel)
        .write([&](GlobalFileWriter& out) { return steps.write(out); },
               attributes.empty() ? NewFile::WriteAttributes() : write_attributes,
               [&] { watched.check_readable(); });
  };
  return watched.run([&] { return with_reader_errors(run); });
}

}  // namespace voxdag::query
