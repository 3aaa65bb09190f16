#include "edit/edit.h"

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>

#include "core/io/file_system.h"
#include "python/native/bindings.h"
#include "python/native/color_argument.h"
#include "python/native/long_work.h"
#include "python/native/memory.h"
#include "python/native/path_text.h"
#include "python/native/scene_parts.h"

namespace voxdag::python {
namespace {

// A file whose voxels are added, and the voxel at which its voxel 0, 0, 0 is placed.
using PartArguments = std::pair<PathText, std::array<int64_t, 3>>;

void edit_file(const PathText& path, const PathText& output, std::vector<std::string> cuts,
               std::vector<PathText> files, std::vector<FileBytes> bytes,
               std::vector<MeshArrays> meshes, const std::vector<PartArguments>& parts,
               uint64_t dilate, uint64_t erode, bool outside_set, bool clip,
               const std::optional<std::array<uint8_t, 3>>& fill_color, uint64_t color_resolution,
               bool no_attributes, const std::string& memory, unsigned threads, bool replace,
               nb::object progress) {
  EditSpec spec;
  spec.cuts = std::move(cuts);
  for (const auto& [part, offset] : parts) spec.parts.push_back({part.bytes, offset});
  spec.dilate = dilate;
  spec.erode = erode;
  spec.outside_set = outside_set;
  spec.input = path.bytes;
  spec.output = output.bytes;
  spec.clip = clip;
  spec.replace = replace;
  spec.fill_color = rgb_of(fill_color);
  spec.color_resolution = color_resolution;
  spec.attributes = !no_attributes;
  spec.memory_bytes = memory_of(memory);
  spec.threads = threads ? threads : default_threads();
  const SceneParts scene{std::move(files), std::move(bytes), std::move(meshes)};
  MeshFiles file_system(system_files());
  add_parts(scene, file_system, spec.scenes);
  run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    return edit(spec, file_system, relay, cancel);
  });
}

}  // namespace

void bind_edit(nb::module_& module) {
  module.def("edit", &edit_file, nb::arg("path"), nb::arg("output"), nb::arg("cuts"),
             nb::arg("files"), nb::arg("bytes"), nb::arg("meshes"), nb::arg("parts"),
             nb::arg("dilate"), nb::arg("erode"), nb::arg("outside_set"), nb::arg("clip"),
             nb::arg("fill_color").none(), nb::arg("color_resolution"), nb::arg("no_attributes"),
             nb::arg("memory"), nb::arg("threads"), nb::arg("replace"), nb::arg("progress").none());
}

}  // namespace voxdag::python
