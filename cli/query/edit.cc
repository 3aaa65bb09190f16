#include "edit/edit.h"

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
#include "core/geometry/cube.h"

namespace voxdag::cli {
namespace {

// Maximum of --dilate and --erode: the edge of the largest grid.
constexpr int kMaxDistance = 1 << kMaxGridLevels;

struct EditCommand {
  std::string input, output, memory;
  std::vector<std::string> cuts, scenes, parts;
  AttributeOptions attributes;
  uint64_t dilate = 0, erode = 0;
  bool clip = false, outside_set = false, force = false, quiet = false, json = false;
  unsigned threads = default_threads();
};

// Parses the value of --paste: a .vdag file, and the voxel of the edited grid at which the file's
// voxel 0,0,0 is placed.
PastedFile pasted_file(const std::string& text) {
  const size_t at = text.rfind('@');
  const auto offset = at == std::string::npos || at == 0
                          ? std::nullopt
                          : parse_numbers<int64_t, 3>(text.substr(at + 1), ',');
  if (!offset)
    throw Error(
        ErrorCode::kInvalidInput,
        "--paste '" + text + "': expected a .vdag file and three whole numbers, PART.vdag@X,Y,Z");
  return {text.substr(0, at), *offset};
}

void run(const EditCommand& command, CommandContext& context) {
  EditSpec spec;
  spec.cuts = command.cuts;
  spec.scenes = command.scenes;
  for (const std::string& part : command.parts) spec.parts.push_back(pasted_file(part));
  spec.dilate = command.dilate;
  spec.erode = command.erode;
  spec.outside_set = command.outside_set;
  spec.input = command.input;
  spec.output = command.output;
  spec.clip = command.clip;
  spec.replace = command.force;
  command.attributes.apply(spec);
  spec.memory_bytes = memory_limit(command.memory);
  spec.threads = command.threads;
  const auto progress = make_progress_bar(command.quiet);
  const RunTimer timer;
  const query::CombineReport report = edit(spec, context.files, *progress, context.cancel);
  const RunTimes times = timer.elapsed();
  if (command.quiet && !command.json) return;
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
  const Option dilate =
      command
          .option("--dilate", state.dilate,
                  "then set all voxels of the grid within N voxels of a set voxel on each axis")
          .range(1, kMaxDistance);
  command
      .option("--erode", state.erode,
              "then keep only the voxels that have no unset voxel within N voxels on each axis")
      .range(1, kMaxDistance)
      .excludes(dilate);
  command.flag("--outside-set", state.outside_set,
               "for --erode, voxels outside of the grid count as set; otherwise as not set");
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
  add_command<EditCommand>(line, "edit",
                           "cut shapes from a DAG, add scenes, paste DAGs, dilate, erode");
}

}  // namespace voxdag::cli
