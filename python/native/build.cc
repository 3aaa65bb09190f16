#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "core/base/text.h"
#include "core/io/file_system.h"
#include "python/native/bindings.h"
#include "python/native/long_work.h"
#include "python/native/path_text.h"
#include "scheduler/plan_build.h"
#include "scheduler/run_build.h"

namespace voxdag::python {
namespace {

// What Python gives; the names are those of the command line.
BuildSpec spec_of(std::vector<PathText> scenes, uint64_t resolution, nb::dict options) {
  BuildSpec spec;
  for (PathText& scene : scenes) spec.geometry.scenes.push_back(std::move(scene.bytes));
  spec.geometry.resolution = resolution;
  // Takes the option out of `options`; None is as if it were not given.
  const auto take = [&](const char* name, auto& value) {
    if (!options.contains(name)) return;
    const nb::object given = options[name];
    nb::del(options[name]);
    if (given.is_none()) return;
    using Value = std::remove_reference_t<decltype(value)>;
    if (!nb::try_cast<Value>(given, value))
      throw Error(ErrorCode::kInvalidInput,
                  std::string(name) + "=" + nb::repr(given).c_str() + ": expected another type");
  };
  std::string memory;
  PathText output, work, cache;
  take("output", output);
  spec.run.output = output.bytes;
  take("bounds", spec.geometry.bounds);
  take("voxel_size", spec.geometry.voxel_size);
  take("skip_invalid", spec.geometry.skip_invalid);
  take("hash_bits", spec.geometry.hash_bits);
  std::vector<std::string> attributes;
  take("color", spec.geometry.attributes[Attribute::kColor]);
  take("attributes", attributes);
  for (const std::string& name : attributes)
    add_attribute(spec.geometry.attributes, name, "attributes");
  take("color_resolution", spec.geometry.color_resolution);
  take("work", work);
  spec.run.work_folder = work.bytes;
  take("memory", memory);
  take("threads", spec.run.threads);
  take("subvolume", spec.run.subvolume_edge);
  take("backend", spec.run.backend);
  take("method", spec.run.method);
  take("cache", cache);
  spec.run.cache_folder = cache.bytes;
  take("keep_work", spec.run.keep_work);
  take("restart", spec.run.restart);
  take("force", spec.run.force);
  for (const auto [name, value] : options)
    throw Error(ErrorCode::kInvalidInput,
                std::string(nb::str(name).c_str()) + ": expected an option of voxdag.build()");
  if (!memory.empty()) spec.run.memory_bytes = parse_size(memory, "memory");
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
