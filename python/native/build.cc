#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>

#include <algorithm>

#include "core/io/file_system.h"
#include "python/native/bindings.h"
#include "python/native/long_work.h"
#include "python/native/path_text.h"
#include "python/native/scene_parts.h"
#include "scheduler/plan_build.h"
#include "scheduler/replaced_result.h"
#include "scheduler/run_build.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag::python {
namespace {

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

// Adds the paths of all parts of `scene` to `spec`, runs work(spec, context) with run_long_work(),
// and returns its result. `context` has a file system in which these paths name the files and
// meshes in memory.
template <class Work>
std::string run_with_scene(BuildSpec spec, const SceneParts& scene, nb::object progress,
                           const Work& work) {
  MeshFiles file_system(system_files());
  add_parts(scene, file_system, spec.geometry.scenes);
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
