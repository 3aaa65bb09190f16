#include "query/components/components.h"

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "core/format/global/open_global.h"
#include "python/native/bindings.h"
#include "python/native/long_work.h"
#include "python/native/memory.h"
#include "python/native/path_text.h"

namespace voxdag::python {
namespace {

// The number of voxels of a component, and the corners of its box.
using ComponentValues = std::pair<uint64_t, std::array<uint32_t, 6>>;

// Returns the number of components, and the largest ones.
std::pair<uint64_t, std::vector<ComponentValues>> components(const PathText& path,
                                                             bool with_corners, uint64_t largest,
                                                             const std::string& memory,
                                                             nb::object progress) {
  const query::ComponentRule rule{
      with_corners ? query::Connectivity::kCorners : query::Connectivity::kFaces, largest};
  MemoryBudget budget(memory_of(memory));
  const query::ComponentsReport report =
      run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
        const auto file = open_global_file(path.bytes);
        return query::find_components(*file, rule, budget, relay, cancel);
      });
  std::vector<ComponentValues> values;
  for (const query::Component& c : report.largest)
    values.push_back({c.voxels, {c.low[0], c.low[1], c.low[2], c.high[0], c.high[1], c.high[2]}});
  return {report.components, std::move(values)};
}

}  // namespace

void bind_components(nb::module_& module) {
  module.def("components", &components, nb::arg("path"), nb::arg("with_corners"),
             nb::arg("largest"), nb::arg("memory"), nb::arg("progress").none());
}

}  // namespace voxdag::python
