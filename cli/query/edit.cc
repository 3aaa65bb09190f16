#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "cli/output.h"
#include "cli/query/attribute_options.h"
#include "cli/query/combine_report.h"
#include "cli/run_times.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "core/io/outputs/temporary_work.h"
#include "core/io/overwrite.h"
#include "query/combine/combine.h"
#include "query/dag/locked_outputs.h"
#include "scene/formats/formats.h"
#include "scheduler/run_build.h"

namespace voxdag::cli {
namespace {

struct EditCommand {
  std::string input, output, memory;
  std::vector<std::string> cuts, scenes, parts;
  AttributeOptions attributes;
  bool clip = false, force = false, quiet = false, json = false;
  unsigned threads = default_threads();
};

// The value of --paste: a .vdag file, and the voxel of the edited grid at which the file's voxel
// 0,0,0 is placed.
struct Part {
  explicit Part(const std::string& text) {
    const size_t at = text.rfind('@');
    const auto numbers = at == std::string::npos || at == 0
                             ? std::nullopt
                             : parse_numbers<int64_t, 3>(text.substr(at + 1), ',');
    if (!numbers)
      throw Error(
          ErrorCode::kInvalidInput,
          "--paste '" + text + "': expected a .vdag file and three whole numbers, PART.vdag@X,Y,Z");
    path = text.substr(0, at);
    offset = *numbers;
  }
  std::string path;
  std::array<int64_t, 3> offset = {};
};

// Returns the files that the scenes of --add name, such as buffers and images. Opens the scenes,
// but only if the output would replace a file: otherwise, no input can be in danger.
std::vector<std::string> files_of_scenes(const EditCommand& command, CommandContext& context) {
  const auto is_present = [&](const std::string& path) {
    const auto file = open_if_there(context.files, path);
    return file && file->size() > 0;
  };
  std::vector<std::string> paths;
  if (command.scenes.empty() || !command.force) return paths;
  if (!is_present(command.output) && !is_present(command.output + ".partial")) return paths;
  MemoryBudget budget(memory_limit(command.memory));
  const auto scene = open_scene(context.files, command.scenes, {}, budget, context.cancel);
  for (const SourceFile& file : scene->files()) paths.push_back(file.path);
  for (const ImageSource& image : scene->materials().images) paths.push_back(image.file.path);
  return paths;
}

// Returns the files that the command reads. The output must not be one of them.
std::vector<std::string> inputs_of(const EditCommand& command, const std::vector<Part>& parts,
                                   CommandContext& context) {
  std::vector<std::string> inputs = files_of_scenes(command, context);
  inputs.push_back(command.input);
  inputs.insert(inputs.end(), command.scenes.begin(), command.scenes.end());
  for (const Part& part : parts) inputs.push_back(part.path);
  return inputs;
}

// Applies the edits in turn: first all cuts, then the scenes of --add, then all pasted files. Each
// edit writes a new file to a temporary folder, and the next edit reads it.
class Edit {
 public:
  Edit(const EditCommand& command, const std::vector<Part>& parts, CommandContext& context,
       FileSystem& files)
      : command_(command),
        context_(context),
        files_(files),
        progress_(make_progress_bar(command.quiet)),
        folder_(files, command.output + ".work-"),
        shapes_(command.cuts.begin(), command.cuts.end()),
        parts_(parts),
        current_(command.input) {
    spec_.first_name = command.input;
    spec_.replace = true;
    spec_.clip = command.clip;
    command.attributes.apply(spec_);
    spec_.memory_bytes = memory_limit(command.memory);
    spec_.threads = command.threads;
  }

  query::CombineReport run() {
    check_parts();
    const bool has_scenes = !command_.scenes.empty();
    if (has_scenes) build_scenes();
    steps_left_ = shapes_.size() + (has_scenes ? 1 : 0) + parts_.size();
    for (const query::Shape& shape : shapes_)
      apply([&](const voxdag_reader::File& file) {
        return query::cut(file, shape, spec_, files_, *progress_, context_.cancel);
      });
    if (has_scenes) unite(scenes_path(), std::nullopt);
    for (const Part& part : parts_) unite(part.path, part.offset);
    files_.rename(current_, command_.output);
    files_.sync_directory(parent_directory(command_.output));
    return total_;
  }

 private:
  std::string scenes_path() const { return folder_.path() + "/scenes.vdag"; }
  // Checks before the first edit that all files can be pasted. The scenes of --add do not change
  // the attributes, because they are built with the attributes of the input.
  void check_parts() {
    const auto input = open_global_file(command_.input);
    const WatchedFile watched_input(*input);
    query::FirstFile first{*input, command_.input, attributes_of(*input), input->empty()};
    query::CombineSpec spec = spec_;
    bool needs_fill_color = false;
    for (const Part& part : parts_) {
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
      progress_->warn(
          "--fill-color has no effect: it is used if a file without colors is pasted to a file "
          "with "
          "colors, or a file with colors to a file without");
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
    if (current_ != command_.input) files_.remove(current_);
    current_ = spec_.output;
  }
  void unite(const std::string& path, const std::optional<std::array<int64_t, 3>>& offset) {
    spec_.operation = query::Operation::kUnion;
    spec_.offset = offset;
    const auto other = open_global_file(path);
    apply([&](const voxdag_reader::File& file) {
      query::CombineSpec spec = spec_;
      if (!query::needs_fill_color({file, spec.first_name, attributes_of(file), file.empty()},
                                   *other, spec))
        spec.fill_color.reset();
      return query::combine(file, *other, spec, files_, *progress_, context_.cancel);
    });
  }
  // Builds the scenes of --add as one DAG, with the grid and the attributes of the input, and
  // writes it to scenes_path().
  void build_scenes() {
    const auto file = open_global_file(command_.input);
    BuildSpec build;
    build.geometry.scenes = command_.scenes;
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
    build.run.threads = command_.threads;
    run_build(build, {files_, *progress_, context_.cancel});
  }

  const EditCommand& command_;
  CommandContext& context_;
  FileSystem& files_;
  const std::unique_ptr<Progress> progress_;
  const TemporaryWork folder_;
  const std::vector<query::Shape> shapes_;
  const std::vector<Part>& parts_;
  query::CombineSpec spec_;
  std::string current_;  // the file that the next edit reads
  size_t steps_left_ = 0;
  query::CombineReport total_;
};

void run(const EditCommand& command, CommandContext& context) {
  if (command.cuts.empty() && command.scenes.empty() && command.parts.empty())
    throw Error(ErrorCode::kInvalidInput, "no edit was given: expected --cut, --add or --paste");
  const std::vector<Part> parts(command.parts.begin(), command.parts.end());
  query::LockedOutputs outputs(
      context.files, {{command.output}, inputs_of(command, parts, context), command.force});
  const RunTimer timer;
  const query::CombineReport report = Edit(command, parts, context, outputs.files()).run();
  const RunTimes times = timer.elapsed();
  if (!command.json) return print_combined(command.output, report, times);
  print_json(combined_json(command.output, report, times));
}

void declare(Command& command, EditCommand& state) {
  command.option("input", state.input, "a .vdag file").required();
  command
      .option("--cut", state.cuts,
              "remove the voxels with centers in sphere:X,Y,Z,R or box:X0,Y0,Z0,X1,Y1,Z1, in "
              "voxels of the grid; may be repeated")
      .one_value_each();
  command
      .option("--add", state.scenes,
              "add a scene, built with the grid and the attributes of the file; may be repeated")
      .one_value_each();
  command
      .option("--paste", state.parts,
              "add the file in PART.vdag@X,Y,Z, whose voxel 0,0,0 comes to voxel X,Y,Z; may be "
              "repeated")
      .one_value_each();
  command.flag("--clip", state.clip,
               "drop voxels that --paste puts outside of the grid; otherwise they are an error");
  state.attributes.declare(command);
  command.output_option("-o,--output", state.output, "the .vdag file to write").required();
  command.memory_option(state.memory);
  command.threads_option(state.threads);
  command.flag("--force", state.force, "replace an existing file");
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_edit_command(CommandLine& line) {
  add_command<EditCommand>(line, "edit", "cut shapes from a DAG, add scenes and paste DAGs");
}

}  // namespace voxdag::cli
