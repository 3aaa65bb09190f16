#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/output.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/clock.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/format/global/open_global.h"
#include "query/render/depth.h"
#include "query/render/renderer.h"
#include "query/render/views.h"

namespace voxdag::cli {
namespace {

constexpr int kMaxPictureEdge = 16384;
// Name endings of picture formats that voxdag does not write. check_ending() refuses them for -o,
// because the output would have another format.
constexpr const char* kOtherPictures[] = {".webp", ".avif", ".gif", ".bmp", ".tif",
                                          ".tiff", ".ppm",  ".pgm", ".exr", ".hdr"};

struct RenderCommand {
  std::string input;
  OutputFile output;
  std::string depth;  // "": no depth map
  std::string view = "auto";
  std::string camera, target;  // texts of the options
  std::optional<double> fov_degrees;
  std::string background = "sky", shade = "color";
  std::string size = "1280x720", memory;
  query::RenderOptions options{.threads = default_threads()};
  bool gray = false;
  bool quiet = false;
  bool json = false;
};

// Parses a point that an option gives in world space. Returns the point in voxel units.
query::Vec parse_point(const std::string& text, const std::string& option,
                       const voxdag_reader::File& file) {
  const auto world = parse_list<double, 3>(option, text, ',', "three numbers X,Y,Z");
  for (const double coordinate : world)
    if (!std::isfinite(coordinate))
      throw Error(ErrorCode::kInvalidInput, option + " '" + text + "': expected finite numbers");
  const double scale = static_cast<double>(file.resolution()) / file.edge();
  query::Vec point;
  for (int axis = 0; axis < 3; ++axis)
    point[axis] = (world[static_cast<size_t>(axis)] - file.origin()[axis]) * scale;
  return point;
}

query::Placement place_camera(const RenderCommand& command, const voxdag_reader::File& file,
                              const query::DagView& dag) {
  query::Placement placement{{{0, 0, 1}}, {{0, 0, 0}}};
  const double aspect = static_cast<double>(command.options.width) / command.options.height;
  if (!dag.empty()) placement = query::named_view(command.view, dag, aspect, command.fov_degrees);
  if (!command.camera.empty()) {
    placement.eye = parse_point(command.camera, "--camera", file);
    placement.target = parse_point(command.target, "--target", file);
    placement.fov_degrees = command.fov_degrees.value_or(50);
  }
  return placement;
}

void report(const RenderCommand& command, const query::Placement& placement,
            const voxdag_reader::File& file, double wall_s) {
  const auto eye = query::world_point(placement.eye, file),
             target = query::world_point(placement.target, file);
  if (command.json) {
    nlohmann::ordered_json json;
    if (!command.output.path.empty()) json["output"] = command.output.path;
    if (!command.depth.empty()) json["depth"] = command.depth;
    json.update({
        {"width", command.options.width},
        {"height", command.options.height},
        {"camera", eye},
        {"target", target},
        {"fov", placement.fov_degrees},
        {"wall_s", wall_s},
    });
    return print_json(json);
  }
  if (command.quiet) return;
  const std::string& name = command.output.path.empty() ? command.depth : command.output.path;
  std::printf("%s: %d x %d, %s\n", printable_line(name).c_str(), command.options.width,
              command.options.height, duration_text(wall_s).c_str());
  std::printf("  --camera %.6g,%.6g,%.6g --target %.6g,%.6g,%.6g --fov %.4g\n", eye[0], eye[1],
              eye[2], target[0], target[1], target[2], placement.fov_degrees);
}

void check_ending(std::string name) {
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const char* ending : kOtherPictures)
    if (name.ends_with(ending))
      throw Error(
          ErrorCode::kInvalidInput,
          "-o " + name +
              ": pictures are written as PNG or JPEG: expected a name that ends in .png or .jpg");
}

void check_outputs(const RenderCommand& command, GuardedOutputs& files) {
  check_ending(command.output.path);
  if (query::is_jpeg_name(command.output.path) &&
      command.options.background == query::Background::kTransparent)
    throw Error(ErrorCode::kInvalidInput, "-o " + command.output.path +
                                              ": a JPEG file cannot be transparent: expected "
                                              "a name that ends in .png");
  if (command.output.path.empty() && command.depth.empty())
    throw Error(ErrorCode::kInvalidInput,
                "no output was given: expected --output, --depth or both");
  if (command.output.path == command.depth)
    throw Error(ErrorCode::kInvalidInput,
                "--output and --depth are both '" + command.depth + "': expected two files");
  if (!command.output.path.empty()) command.output.guard(files);
  if (!command.output.path.empty())
    command.output.check(files, command.input, query::is_rendered_picture);
  if (command.depth.empty()) return;
  const OutputFile depth{command.depth, command.output.force};
  depth.guard(files);
  // A .npy file does not record the program that wrote it, so only --force replaces it.
  depth.check(files, command.input, [](const ReadableFile&) { return false; });
}

// Throws Error{kOutOfMemory}, before any work is done, if a picture or depth map of the requested
// size exceeds --memory. `shade_bytes` is the memory of --shade.
void check_memory(const RenderCommand& command, uint64_t shade_bytes = 0) {
  const uint64_t limit = memory_limit(command.memory);
  // The picture is written and freed before the depth map is computed, so they are never in memory
  // together. If both are requested, the picture's memory is checked, because it is larger.
  const uint64_t of_pixel = command.output.path.empty()
                                ? query::kDepthBytesPerPixel
                                : query::render_bytes_per_pixel(command.options.background);
  const uint64_t bytes = of_pixel * static_cast<uint64_t>(command.options.width) *
                             static_cast<uint64_t>(command.options.height) +
                         shade_bytes;
  if (bytes > limit)
    throw Error(ErrorCode::kOutOfMemory, "--size " + command.size + " takes " + size_text(bytes) +
                                             " of memory, expected at most " + size_text(limit) +
                                             ": choose a smaller size, or a higher --memory");
}

void run(RenderCommand& command, CommandContext& context) {
  const auto [width, height] = parse_list<int, 2>("--size", command.size, 'x', "WIDTHxHEIGHT");
  if (width < 1 || height < 1 || width > kMaxPictureEdge || height > kMaxPictureEdge)
    throw Error(ErrorCode::kInvalidInput, "--size '" + command.size +
                                              "': expected a width and a height of 1 to " +
                                              std::to_string(kMaxPictureEdge) + " pixels");
  command.options.background = query::background_named(command.background);
  command.options.shade = query::shade_named(command.shade);
  command.options.width = width;
  command.options.height = height;
  GuardedOutputs files(context.files);
  check_outputs(command, files);
  check_memory(command);
  const auto progress = make_progress_bar(command.quiet);
  const auto file = open_global_file(command.input);
  const query::DagView dag(*file);
  check_memory(command, query::shade_bytes(dag, command.options.shade));
  if (!command.gray) command.options.colors = file.get();
  if (dag.empty())
    progress->warn(command.input + " has no voxels: the picture shows only the background");
  const double start_s = wall_seconds();
  const query::Placement placement = place_camera(command, *file, dag);
  if (!command.output.path.empty()) {
    const query::Picture picture =
        query::render_picture(dag, placement, command.options, *progress, context.cancel);
    write_file_atomically(files, command.output.path,
                          query::encode_picture(picture, command.output.path));
  }
  if (!command.depth.empty()) {
    const query::DepthMap map =
        query::render_depth(dag, placement, width, height, command.options.threads, context.cancel);
    write_file_atomically(files, command.depth, query::encode_npy(map));
  }
  report(command, placement, *file, wall_seconds() - start_s);
}

void declare(Command& command, RenderCommand& state) {
  command.option("input", state.input, "the .vdag file").required();
  const Option picture =
      command.output_option("-o,--output", state.output.path, "the .png or .jpg file to write");
  command.output_option(
      "--depth", state.depth,
      "the .npy file to write: distances in voxels, inf where there is no surface");
  const Option view =
      command.option("--view", state.view, "named view").one_of(query::view_names()).show_default();
  Option camera = command.option("--camera", state.camera, "X,Y,Z of the camera, in scene units");
  Option target = command.option("--target", state.target, "X,Y,Z of the point that it looks at");
  camera.needs(target).excludes(view);
  target.needs(camera);
  command.option("--fov", state.fov_degrees, "vertical field of view in degrees").range(1.0, 170.0);
  command.option("--size", state.size, "WIDTHxHEIGHT in pixels").show_default();
  command.option("--samples", state.options.samples, "N: N * N samples per pixel")
      .range(1, 8)
      .needs(picture)
      .show_default();
  command.option("--background", state.background, "what pixels without a surface show")
      .one_of(query::background_names())
      .needs(picture)
      .show_default();
  command
      .option(
          "--shade", state.shade,
          "what the colors show: the scene's colors, how often equal parts occur (sharing), the "
          "levels of the visible cells, or the normals")
      .one_of(query::shade_names())
      .needs(picture)
      .show_default();
  command.flag("--gray", state.gray, "leave out the colors that the file may have").needs(picture);
  command.option("--memory", state.memory,
                 "limit of the memory that is allocated (default: half the RAM; at least 64MiB)");
  command.threads_option(state.options.threads);
  state.output.declare_force(command);
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_render_command(CommandLine& line) {
  add_command<RenderCommand>(line, "render", "render a picture of a DAG");
}

}  // namespace voxdag::cli
