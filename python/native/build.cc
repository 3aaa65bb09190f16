#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>

#include "core/io/file_system.h"
#include "python/native/bindings.h"
#include "python/native/long_work.h"
#include "python/native/path_text.h"
#include "scheduler/plan_build.h"
#include "scheduler/run_build.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag::python {
namespace {

// Takes the options out of a dict of keyword arguments; None is as if it were not given.
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
    } else if constexpr (NamedEnum<T> || std::is_integral_v<T>) {
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
    } else {
      return nb::try_cast<T>(object, value);
    }
  }

  nb::dict given_;
};

BuildSpec spec_of(std::vector<PathText> scenes, uint64_t resolution, nb::dict options) {
  BuildSpec spec;
  for (PathText& scene : scenes) spec.geometry.scenes.push_back(std::move(scene.bytes));
  spec.geometry.resolution = resolution;
  KeywordReader reader(std::move(options));
  fields(reader, spec);
  reader.refuse_others();
  return spec;
}

std::string build(std::vector<PathText> scenes, uint64_t resolution, nb::object progress,
                  nb::dict options) {
  const BuildSpec spec = spec_of(std::move(scenes), resolution, std::move(options));
  return run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    return report_json(run_build(spec, {system_files(), relay, cancel}));
  });
}

std::string plan(std::vector<PathText> scenes, uint64_t resolution, nb::object progress,
                 nb::dict options) {
  const BuildSpec spec = spec_of(std::move(scenes), resolution, std::move(options));
  return run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    return estimate_json(plan_build(spec, {system_files(), relay, cancel}));
  });
}

}  // namespace

void bind_build(nb::module_& module) {
  module.def("build", &build, nb::arg("scenes"), nb::arg("resolution"), nb::arg("progress").none(),
             nb::arg("options"));
  module.def("plan", &plan, nb::arg("scenes"), nb::arg("resolution"), nb::arg("progress").none(),
             nb::arg("options"));
}

}  // namespace voxdag::python
