#include "scene/formats/formats.h"

#include <algorithm>
#include <utility>

#include "core/base/options/option_text.h"
#include "core/io/buffered/small_file.h"
#include "scene/chained_scene.h"
#include "scene/formats/unknown_file.h"
#include "scene/gltf/gltf_scene.h"
#include "scene/gltf/json/container.h"
#include "scene/messages.h"
#include "scene/obj/obj_scene.h"
#include "scene/ply/ply_scene.h"
#include "scene/points/las_header.h"
#include "scene/points/las_points.h"
#include "scene/points/text_points.h"
#include "scene/stl/stl_scene.h"
#include "scene/text/characters.h"
#include "scene/text/other_formats.h"

namespace voxdag {
namespace {

constexpr std::string_view kGltfEndings[] = {".glb", ".gltf"};
constexpr std::string_view kPlyEndings[] = {".ply"};
constexpr std::string_view kObjEndings[] = {".obj"};
constexpr std::string_view kStlEndings[] = {".stl"};
constexpr std::string_view kLasEndings[] = {".las"};
constexpr std::string_view kTextPointEndings[] = {".xyz", ".txt", ".csv"};

bool is_points(const ReadableFile& file) {
  return !is_other_text(first_bytes_of(file)) && points::is_text_points(file);
}

constexpr SceneFormat kFormats[] = {
    {"glTF", kGltfEndings, gltf::is_gltf, gltf::open_gltf},
    {"PLY", kPlyEndings, ply::is_ply, ply::open_ply},
    {"LAS", kLasEndings, points::is_las, points::open_las},
    {"OBJ", kObjEndings, obj::is_obj, obj::open_obj},
    {"STL", kStlEndings, stl::is_stl, stl::open_stl},
    // This row is last, because its sniff() accepts almost any text in a file with one of the
    // endings.
    {"text points", kTextPointEndings, is_points, points::open_text_points},
};

const SceneFormat& format_of(const ReadableFile& file) {
  for (const SceneFormat& format : kFormats)
    if (format.sniff(file)) return format;
  refuse_unknown_file(file);
}

// The first files of a scene are read in one step, as long as they have at most this total size.
constexpr uint64_t kSmallSceneBytes = uint64_t{1} << 20;

using Parts = std::vector<std::unique_ptr<TriangleSource>>;

// Returns a warning for each option that the user has given but that affects no file of the scene.
std::vector<Warning> unused_options(const Parts& parts, const SceneOptions& options) {
  std::vector<Warning> warnings;
  const auto check = [&](const std::string& option, const char* reason, const auto& is_used) {
    const auto uses = [&](const auto& part) { return is_used(part->used_options()); };
    if (std::ranges::none_of(parts, uses))
      warnings.push_back({"unused-option", "", option + " has no effect: " + reason});
  };
  if (options.point_radius > 0)
    check(option_text("point_radius"), "no file of the scene is a file of points",
          [](const UsedOptions& used) { return used.point_radius; });
  if (!options.columns.empty())
    check(option_text("columns"), "no file of the scene is a text file with points",
          [](const UsedOptions& used) { return used.columns; });
  for (const std::string& name : options.ignored_extensions)
    check(option_text("ignore_extension", printable(name)),
          "no glTF file of the scene requires this extension, or voxdag reads it",
          [&](const UsedOptions& used) {
            return std::ranges::find(used.ignored_extensions, name) !=
                   used.ignored_extensions.end();
          });
  return warnings;
}

std::vector<std::string_view> all_endings() {
  std::vector<std::string_view> all;
  for (const SceneFormat& format : kFormats)
    all.insert(all.end(), format.endings.begin(), format.endings.end());
  return all;
}

}  // namespace

std::span<const SceneFormat> scene_formats() { return kFormats; }

bool has_scene_ending(std::string_view name) {
  return std::ranges::any_of(all_endings(), [&](std::string_view ending) {
    return name.size() >= ending.size() &&
           equals_in_any_case(name.substr(name.size() - ending.size()), ending);
  });
}

std::string list_scene_endings(const std::string& separator, const std::string& last_separator) {
  const std::vector<std::string_view> all = all_endings();
  std::string list;
  for (size_t i = 0; i < all.size(); ++i) {
    if (i > 0) list += i + 1 < all.size() ? separator : last_separator;
    list += all[i];
  }
  return list;
}

std::unique_ptr<TriangleSource> open_scene(FileSystem& files, const std::vector<std::string>& paths,
                                           const SceneOptions& options, MemoryBudget& budget,
                                           const CancelToken& cancel) {
  Parts parts;
  SmallFiles small_files(kSmallSceneBytes, budget);
  for (const std::string& path : paths) {
    cancel.check();
    std::unique_ptr<ReadableFile> file = small_files.read(files.open_read(path));
    const SceneFormat& format = format_of(*file);
    parts.push_back(format.open(files, std::move(file), options, budget, cancel));
  }
  std::vector<Warning> warnings = unused_options(parts, options);
  return chain_scenes(std::move(parts), std::move(warnings));
}

}  // namespace voxdag
