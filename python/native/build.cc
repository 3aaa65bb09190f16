#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "core/io/file_system.h"
#include "python/native/bindings.h"
#include "python/native/long_work.h"
#include "python/native/path_text.h"
#include "scene/mesh_files.h"
#include "scheduler/plan_build.h"
#include "scheduler/replaced_result.h"
#include "scheduler/run_build.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag::python {
namespace {

// The vertices of a mesh, one per row, as float32 or float64. mesh_of() throws for any other type.
using Vertices = nb::ndarray<nb::ro, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
template <class Number, ssize_t Columns>
using Matrix = nb::ndarray<const Number, nb::shape<-1, Columns>, nb::c_contig, nb::device::cpu>;

// A scene file in memory: a path, which is its name in messages, and its bytes.
using FileBytes = std::pair<std::string, nb::bytes>;

// A mesh of a scene: a path, which is its name in messages; vertices; triangles; the colors of the
// vertices; and a texture: the name of its material, the bytes of an image file, and the texture
// coordinates of the vertices.
using MeshArrays =
    std::tuple<std::string, Vertices, Matrix<uint32_t, 3>, std::optional<Matrix<uint8_t, 4>>,
               std::string, nb::bytes, std::optional<Matrix<float, 2>>>;

template <class Number>
std::span<const Number> numbers_of(const auto& rows) {
  return {static_cast<const Number*>(rows.data()), rows.size()};
}

std::span<const std::byte> bytes_of(const nb::bytes& bytes) {
  return {static_cast<const std::byte*>(bytes.data()), bytes.size()};
}

Mesh mesh_of(const MeshArrays& arrays) {
  const auto& [path, vertices, triangles, colors, name, texture, coordinates] = arrays;
  Mesh mesh;
  if (vertices.dtype() == nb::dtype<float>())
    mesh.positions = numbers_of<float>(vertices);
  else if (vertices.dtype() == nb::dtype<double>())
    mesh.positions = numbers_of<double>(vertices);
  else
    throw nb::type_error("vertices: expected float32 or float64");
  mesh.indices = numbers_of<uint32_t>(triangles);
  if (colors) mesh.colors = numbers_of<uint8_t>(*colors);
  if (!coordinates) return mesh;
  mesh.texture_name = name;
  mesh.texture = bytes_of(texture);
  mesh.texture_coordinates = numbers_of<float>(*coordinates);
  return mesh;
}

// Sets the members of a BuildSpec from a dict of keyword arguments, and removes these arguments
// from the dict. An argument that is None counts as absent. Throws Error{kInvalidInput} for a wrong
// value.
class KeywordReader {
 public:
  explicit KeywordReader(nb::dict given) : given_(std::move(given)) {}

  template <class T>
  void operator()(const Field& field, T& value) {
    if (!given_.contains(field.name)) return;
    const nb::object object = given_[field.name];
    nb::del(given_[field.name]);
    if (object.is_none()) return;
    const T standard = value;
    if (!read(field, object, value) || (value != standard && !fits(field, value)))
      throw Error(ErrorCode::kInvalidInput, std::string(field.name) + "=" +
                                                nb::repr(object).c_str() + ": expected " +
                                                expectation<T>(field));
  }

  void refuse_others() const {
    for (const auto [name, value] : given_)
      throw Error(ErrorCode::kInvalidInput,
                  std::string(nb::str(name).c_str()) + ": expected an option of voxdag.build()");
  }

 private:
  template <class T>
  static bool read(const Field& field, const nb::object& object, T& value) {
    if constexpr (IsOptional<T>::value) {
      return read(field, object, value.emplace());
    } else if constexpr (std::is_same_v<T, std::string>) {
      PathText text;
      if (!nb::try_cast<PathText>(object, text)) return false;
      value = std::move(text.bytes);
      return true;
    } else if constexpr (NamedEnum<T> || (std::is_integral_v<T> && !std::is_same_v<T, bool>)) {
      if constexpr (std::is_integral_v<T>)
        if (!nb::isinstance<nb::str>(object)) return nb::try_cast<T>(object, value);
      std::string text;
      return (NamedEnum<T> || field.is_bytes) && nb::try_cast<std::string>(object, text) &&
             parse_text(field, text, value);
    } else if constexpr (NameSet<T>) {
      std::vector<std::string> names;
      return nb::try_cast<std::vector<std::string>>(object, names) &&
             std::ranges::all_of(names, [&](const std::string& name) {
               return NameSetTraits<T>::add(value, name);
             });
    } else if constexpr (IsVector<T>::value) {
      const bool is_item = nb::isinstance<nb::str>(object);
      return is_item ? read(field, object, value.emplace_back()) : nb::try_cast<T>(object, value);
    } else {
      return nb::try_cast<T>(object, value);
    }
  }

  nb::dict given_;
};

BuildSpec spec_of(uint64_t resolution, nb::dict options) {
  BuildSpec spec;
  spec.geometry.resolution = resolution;
  KeywordReader reader(std::move(options));
  fields(reader, spec);
  reader.refuse_others();
  return spec;
}

// The parts of one scene. `bytes` are files in memory.
struct SceneParts {
  std::vector<PathText> files;
  std::vector<FileBytes> bytes;
  std::vector<MeshArrays> meshes;
};

// Adds the paths of all parts of `scene` to `spec`, runs work(spec, context) with run_long_work(),
// and returns its result. `context` has a file system in which these paths name the files and
// meshes in memory.
template <class Work>
std::string run_with_scene(BuildSpec spec, SceneParts scene, nb::object progress,
                           const Work& work) {
  std::vector<std::string>& scenes = spec.geometry.scenes;
  MeshFiles file_system(system_files());
  for (PathText& file : scene.files) scenes.push_back(std::move(file.bytes));
  for (const auto& [path, bytes] : scene.bytes) {
    scenes.push_back(path);
    file_system.add_file(path, bytes_of(bytes));
  }
  for (const MeshArrays& mesh : scene.meshes) {
    scenes.push_back(std::get<0>(mesh));
    file_system.add(scenes.back(), mesh_of(mesh));
  }
  return run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    return work(spec, BuildContext{file_system, relay, cancel});
  });
}

std::string build(std::vector<PathText> files, std::vector<FileBytes> bytes,
                  std::vector<MeshArrays> meshes, uint64_t resolution, nb::object progress,
                  nb::dict options) {
  return run_with_scene(spec_of(resolution, std::move(options)),
                        {std::move(files), std::move(bytes), std::move(meshes)},
                        std::move(progress),
                        [](const BuildSpec& spec, const BuildContext& context) {
                          refuse_result_of_other_scene(context.files, spec);
                          return report_json(run_build(spec, context));
                        });
}

std::string plan(std::vector<PathText> files, std::vector<FileBytes> bytes,
                 std::vector<MeshArrays> meshes, uint64_t resolution, nb::object progress,
                 nb::dict options) {
  return run_with_scene(spec_of(resolution, std::move(options)),
                        {std::move(files), std::move(bytes), std::move(meshes)},
                        std::move(progress),
                        [](const BuildSpec& spec, const BuildContext& context) {
                          return estimate_json(plan_build(spec, context));
                        });
}

}  // namespace

void bind_build(nb::module_& module) {
  module.def("build", &build, nb::arg("files"), nb::arg("bytes"), nb::arg("meshes"),
             nb::arg("resolution"), nb::arg("progress").none(), nb::arg("options"));
  module.def("plan", &plan, nb::arg("files"), nb::arg("bytes"), nb::arg("meshes"),
             nb::arg("resolution"), nb::arg("progress").none(), nb::arg("options"));
}

}  // namespace voxdag::python
