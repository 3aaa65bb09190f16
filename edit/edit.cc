#include "edit/edit.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/base/options/option_text.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "core/io/outputs/temporary_work.h"
#include "core/io/overwrite.h"
#include "query/attributes/color_levels.h"
#include "query/dag/locked_outputs.h"
#include "query/morphology/morphology.h"
#include "scene/formats/formats.h"
#include "scheduler/run_build.h"

namespace voxdag {
namespace {

// Returns the files that the added scenes name, such as buffers and images. Opens the scenes, but
// only if the output would replace a file: otherwise, no input can be in danger.
std::vector<std::string> files_of_scenes(const EditSpec& spec, FileSystem& files,
                                         const CancelToken& cancel) {
  const auto is_present = [&](const std::string& path) {
    const auto file = open_if_there(files, path);
    return file && file->size() > 0;
  };
  std::vector<std::string> paths;
  if (spec.scenes.empty() || !spec.replace) return paths;
  if (!is_present(spec.output) && !is_present(spec.output + ".partial")) return paths;
  MemoryBudget budget(spec.memory_bytes);
  const auto scene = open_scene(files, spec.scenes, {}, budget, cancel);
  for (const SourceFile& file : scene->files()) paths.push_back(file.path);
  for (const ImageSource& image : scene->materials().images) paths.push_back(image.file.path);
  return paths;
}

// Returns the files that an edit reads. The output must not be one of them.
std::vector<std::string> inputs_of(const EditSpec& spec, FileSystem& files,
                                   const CancelToken& cancel) {
  std::vector<std::string> inputs = files_of_scenes(spec, files, cancel);
  inputs.push_back(spec.input);
  inputs.insert(inputs.end(), spec.scenes.begin(), spec.scenes.end());
  for (const PastedFile& part : spec.parts) inputs.push_back(part.path);
  return inputs;
}

// Applies the edits in turn. Each edit writes a new file to a temporary folder, and the next edit
// reads it.
class Edit {
 public:
  Edit(const EditSpec& spec, FileSystem& files, Progress& progress, const CancelToken& cancel)
      : edit_(spec),
        files_(files),
        progress_(progress),
        cancel_(cancel),
        folder_(files, spec.output + ".work-"),
        shapes_(spec.cuts.begin(), spec.cuts.end()),
        current_(spec.input) {
    spec_.first_name = spec.input;
    spec_.replace = true;
    spec_.clip = spec.clip;
    spec_.fill_color = spec.fill_color;
    spec_.color_resolution = spec.color_resolution;
    spec_.attributes = spec.attributes;
    spec_.memory_bytes = spec.memory_bytes;
    spec_.threads = spec.threads;
  }

  query::CombineReport run() {
    check_parts();
    const bool has_scenes = !edit_.scenes.empty();
    if (has_scenes) build_scenes();
    const bool has_morphology = edit_.dilate + edit_.erode > 0;
    steps_left_ = shapes_.size() + (has_scenes ? 1 : 0) + edit_.parts.size() + has_morphology;
    for (const query::Shape& shape : shapes_)
      apply([&](const voxdag_reader::File& file) {
        return query::cut(file, shape, spec_, files_, progress_, cancel_);
      });
    if (has_scenes) unite(scenes_path(), std::nullopt);
    for (const PastedFile& part : edit_.parts) unite(part.path, part.offset);
    if (has_morphology)
      apply([&](const voxdag_reader::File& file) {
        const query::Morphology morphology{edit_.erode > 0, edit_.dilate + edit_.erode,
                                           edit_.outside_set};
        return query::change_by_cube(file, morphology, spec_, files_, progress_, cancel_);
      });
    files_.rename(current_, edit_.output);
    files_.sync_directory(parent_directory(edit_.output));
    return total_;
  }

 private:
  std::string scenes_path() const { return folder_.path() + "/scenes.vdag"; }
  // Checks before the first edit that all files can be pasted. Added scenes do not change the
  // attributes, because they are built with the attributes of the input.
  void check_parts() {
    const auto input = open_global_file(edit_.input);
    const WatchedFile watched_input(*input);
    query::FirstFile first{*input, edit_.input, attributes_of(*input), input->empty()};
    query::CombineSpec spec = spec_;
    bool needs_fill_color = false;
    for (const PastedFile& part : edit_.parts) {
      spec.offset = part.offset;
      const auto file = open_global_file(part.path);
      const WatchedFile watched(*file);
      watched.run([&] {
        needs_fill_color |= query::needs_fill_color(first, *file, spec);
        first.attributes =
            with_reader_errors([&] { return query::check_combinable(first, *file, spec); });
      });
      first.is_empty &= file->empty();
    }
    if (spec.fill_color && !needs_fill_color)
      progress_.warn(option_text("fill_color") +
                     " has no effect: it is used if a file without colors is pasted to a file with "
                     "colors, or a file with colors to a file without");
    if (spec_.color_resolution == 0 || first.attributes.any()) return;
    query::refuse_color_resolution(*input, spec_.color_resolution);
    progress_.warn(query::unused_color_resolution());
    spec_.color_resolution = 0;
  }
  template <class Step>
  void apply(const Step& step) {
    spec_.output = folder_.path() + "/" + std::to_string(steps_left_--) + ".vdag";
    spec_.temporary = steps_left_ > 0;
    const auto file = open_global_file(current_);
    query::CombineReport report = step(*file);
    report.pairs += total_.pairs;
    report.clipped += total_.clipped;
    report.work_bytes += total_.work_bytes;
    total_ = report;
    if (current_ != edit_.input) files_.remove(current_);
    current_ = spec_.output;
  }
  void unite(const std::string& path, const std::optional<std::array<int64_t, 3>>& offset) {
    spec_.operation = query::Operation::kUnion;
    spec_.offset = offset;
    spec_.clip = edit_.clip && offset.has_value();
    const auto other = open_global_file(path);
    apply([&](const voxdag_reader::File& file) {
      query::CombineSpec spec = spec_;
      if (!query::needs_fill_color({file, spec.first_name, attributes_of(file), file.empty()},
                                   *other, spec))
        spec.fill_color.reset();
      if (!attributes_of(file).any() && !attributes_of(*other).any()) spec.color_resolution = 0;
      return query::combine(file, *other, spec, files_, progress_, cancel_);
    });
  }
  // Builds the added scenes as one DAG, with the grid and the attributes of the input, and writes
  // it to scenes_path().
  void build_scenes() {
    const auto file = open_global_file(edit_.input);
    BuildSpec build;
    build.geometry.scenes = edit_.scenes;
    build.geometry.resolution = static_cast<uint64_t>(file->resolution());
    build.geometry.bounds = {file->origin()[0], file->origin()[1], file->origin()[2], file->edge()};
    build.geometry.hash_bits = file->hash_bits();
    if (spec_.attributes) build.geometry.attributes = attributes_of(*file);
    uint64_t cells = 0;
    for (const Attribute attribute : build.geometry.attributes.list())
      cells = std::max(cells, uint64_t{1} << section_of(*file, attribute).color_levels());
    if (spec_.color_resolution > 0) cells = std::min(cells, spec_.color_resolution);
    build.geometry.color_resolution = cells;
    build.run.output = scenes_path();
    build.run.report = "none";
    build.run.memory_bytes = spec_.memory_bytes;
    build.run.threads = edit_.threads;
    run_build(build, {files_, progress_, cancel_});
  }

  const EditSpec& edit_;
  FileSystem& files_;
  Progress& progress_;
  const CancelToken& cancel_;
  const TemporaryWork folder_;
  const std::vector<query::Shape> shapes_;
  query::CombineSpec spec_;
  std::string current_;  // the file that the next edit reads
  size_t steps_left_ = 0;
  query::CombineReport total_;
};

}  // namespace

query::CombineReport edit(const EditSpec& spec, FileSystem& files, Progress& progress,
                          const CancelToken& cancel) {
  if (spec.outside_set && spec.erode == 0)
    throw Error(ErrorCode::kInvalidInput, option_text("outside_set") +
                                              " was given without an erosion: expected " +
                                              option_text("erode"));
  if (spec.clip && spec.parts.empty())
    throw Error(ErrorCode::kInvalidInput, option_text("clip") +
                                              " was given without a file to paste: expected " +
                                              option_text("paste"));
  query::check_attribute_options(spec.attributes, spec.fill_color.has_value(),
                                 spec.color_resolution);
  if (spec.cuts.empty() && spec.scenes.empty() && spec.parts.empty() && spec.dilate == 0 &&
      spec.erode == 0)
    throw Error(ErrorCode::kInvalidInput, "no edit was given: expected " + option_text("cut") +
                                              ", " + option_text("add") + ", " +
                                              option_text("paste") + ", " + option_text("dilate") +
                                              " or " + option_text("erode"));
  if (spec.dilate > 0 && spec.erode > 0)
    throw Error(ErrorCode::kInvalidInput,
                option_text("dilate") + " and " + option_text("erode") +
                    " were both given: expected one of them, and the other in an edit of the "
                    "result");
  query::LockedOutputs outputs(files,
                               {{spec.output}, inputs_of(spec, files, cancel), spec.replace});
  return Edit(spec, outputs.files(), progress, cancel).run();
}

}  // namespace voxdag
