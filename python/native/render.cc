#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/base/process_limits.h"
#include "core/format/global/open_global.h"
#include "python/native/bindings.h"
#include "python/native/long_work.h"
#include "python/native/memory.h"
#include "python/native/path_text.h"
#include "query/render/renderer.h"
#include "query/render/views.h"

namespace voxdag::python {
namespace {

using Point = std::array<double, 3>;
using Pixels = nb::ndarray<uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

// Returns a point of world space in voxel units. `what` names the point in messages. Throws
// Error{kInvalidInput} if a coordinate is not finite.
query::Vec in_voxels(const Point& point, const char* what, const voxdag_reader::File& file) {
  query::Vec voxels;
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(point[axis]))
      throw Error(ErrorCode::kInvalidInput,
                  "the " + std::string(what) + " is not finite: expected finite coordinates");
    voxels[static_cast<int>(axis)] =
        (point[axis] - file.origin()[axis]) * static_cast<double>(file.resolution()) / file.edge();
  }
  return voxels;
}

// Returns the memory that the shade needs for this file.
uint64_t shade_memory(const PathText& path, const std::string& shade) {
  const query::Shade kind = query::shade_named(shade);
  if (kind != query::Shade::kSharing) return 0;
  const auto file = open_global_file(path.bytes);
  return query::shade_bytes(query::DagView(*file), kind);
}

// Throws Error{kOutOfMemory} if the memory of the renderer, the shade and the array of pixels
// together exceed the limit `memory`. voxdag.render() calls this function before it allocates the
// array, because the system can end a process that allocates too much memory.
void check_memory(const PathText& path, int width, int height, const std::string& background,
                  const std::string& shade, const std::string& memory) {
  const uint64_t limit = memory_of(memory);
  const query::Background kind = query::background_named(background);
  const uint64_t of_pixel =
      query::render_bytes_per_pixel(kind) + static_cast<uint64_t>(query::channels_of(kind));
  const uint64_t bytes = of_pixel * static_cast<uint64_t>(width) * static_cast<uint64_t>(height) +
                         shade_memory(path, shade);
  if (bytes > limit)
    throw Error(ErrorCode::kOutOfMemory,
                "a picture of " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels takes " + size_text(bytes) + " of memory, expected at most " +
                    size_text(limit) + ": choose a smaller size, or more with memory=");
}

// Fills `pixels` with the picture. If `camera` is nullopt, the view named `view` determines the
// camera.
void render(const PathText& path, const std::string& view, const std::optional<Point>& camera,
            const Point& target, std::optional<double> fov_degrees, int samples,
            const std::string& background, const std::string& shade, bool gray, unsigned threads,
            nb::object progress, const Pixels& pixels) {
  query::RenderOptions options;
  options.height = static_cast<int>(pixels.shape(0));
  options.width = static_cast<int>(pixels.shape(1));
  options.samples = samples;
  options.background = query::background_named(background);
  options.shade = query::shade_named(shade);
  options.threads = threads ? threads : default_threads();
  uint8_t* const to = pixels.data();
  run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    const auto file = open_global_file(path.bytes);
    const query::DagView dag(*file);
    if (!gray) options.colors = file.get();
    if (dag.empty())
      relay.warn(path.bytes + " has no voxels: the picture shows only the background");
    query::Placement placement{{{0, 0, 1}}, {{0, 0, 0}}};
    const double aspect = static_cast<double>(options.width) / options.height;
    if (camera)
      placement = {in_voxels(*camera, "camera", *file), in_voxels(target, "target", *file),
                   fov_degrees.value_or(50)};
    else if (!dag.empty())
      placement = query::named_view(view, dag, aspect, fov_degrees, cancel);
    const query::Picture picture = query::render_picture(dag, placement, options, relay, cancel);
    std::ranges::copy(picture.bytes, to);
    return true;
  });
}

}  // namespace

void bind_render(nb::module_& module) {
  module.def("check_render_memory", &check_memory, nb::arg("path"), nb::arg("width"),
             nb::arg("height"), nb::arg("background"), nb::arg("shade"), nb::arg("memory"));
  module.def("render", &render, nb::arg("path"), nb::arg("view"), nb::arg("camera").none(),
             nb::arg("target"), nb::arg("fov").none(), nb::arg("samples"), nb::arg("background"),
             nb::arg("shade"), nb::arg("gray"), nb::arg("threads"), nb::arg("progress").none(),
             nb::arg("pixels"));
}

}  // namespace voxdag::python
