#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <nlohmann/json.hpp>

#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/format/global/open_global.h"
#include "core/io/file_system.h"
#include "python/native/bindings.h"
#include "python/native/long_work.h"
#include "query/export/export.h"
#include "query/extract/extract.h"

namespace voxdag::python {
namespace {

using Corner = std::array<int64_t, 3>;

query::Selection selection_of(uint32_t grid_levels, const Corner& low, const Corner& high) {
  const query::Region whole = query::whole_grid(grid_levels);
  query::Selection selection{grid_levels, {low, high}};
  for (size_t axis = 0; axis < 3; ++axis) {
    selection.region.low[axis] = std::clamp<int64_t>(low[axis], 0, whole.high[axis]);
    selection.region.high[axis] = std::clamp<int64_t>(high[axis], 0, whole.high[axis]);
  }
  if (selection.region.empty())
    throw Error(ErrorCode::kInvalidInput,
                "the region lies outside the grid: expected one that has voxels of the grid");
  return selection;
}

uint64_t memory_of(const std::string& text) {
  const uint64_t bytes = text.empty() ? default_memory() : parse_size(text, "memory");
  if (bytes < kMinMemory)
    throw Error(ErrorCode::kInvalidInput, "memory: " + text + ", expected at least 64MiB");
  return bytes;
}

std::string extract(const std::string& path, const std::string& output, uint32_t grid_levels,
                    const Corner& low, const Corner& high, bool crop, const std::string& memory,
                    unsigned threads, nb::object progress) {
  query::ExtractSpec spec;
  spec.selection = selection_of(grid_levels, low, high);
  spec.crop = crop;
  spec.output = output;
  spec.memory_bytes = memory_of(memory);
  spec.threads = threads ? threads : default_threads();
  return run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    const auto file = open_global_file(path);
    const query::ExtractReport report = query::extract(*file, spec, system_files(), relay, cancel);
    return nlohmann::json{{"resolution", report.grid.resolution()},
                          {"bounds", {{"origin", report.grid.origin}, {"edge", report.grid.edge}}},
                          {"voxels", report.voxels},
                          {"svo_nodes", report.svo_nodes},
                          {"dag_nodes", report.dag_nodes},
                          {"bytes", report.bytes},
                          {"sha256", report.sha256}}
        .dump();
  });
}

std::string export_file(const std::string& path, const std::string& output,
                        const std::string& format, uint32_t grid_levels, const Corner& low,
                        const Corner& high, const std::string& memory, bool gray,
                        nb::object progress) {
  query::ExportRequest request;
  request.gray = gray;
  request.format = &query::export_format(format);
  request.selection = selection_of(grid_levels, low, high);
  request.output = output;
  request.memory_bytes = memory_of(memory);
  return run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    const auto file = open_global_file(path);
    const query::ExportReport report =
        query::export_dag(system_files(), *file, request, relay, cancel);
    return nlohmann::json{{"files", report.files},
                          {"bytes", report.bytes},
                          {"voxels", report.voxels},
                          {"notes", report.notes}}
        .dump();
  });
}

// The files that an export would write.
std::vector<std::string> export_paths(const std::string& format, const std::string& output) {
  return query::export_paths(query::export_format(format), output);
}

std::vector<std::pair<std::string, std::string>> export_formats() {
  std::vector<std::pair<std::string, std::string>> formats;
  for (const query::ExportFormat& format : query::export_formats())
    formats.emplace_back(format.name, format.summary);
  return formats;
}

}  // namespace

void bind_derive(nb::module_& module) {
  module.def("extract", &extract, nb::arg("path"), nb::arg("output"), nb::arg("grid_levels"),
             nb::arg("low"), nb::arg("high"), nb::arg("crop"), nb::arg("memory"),
             nb::arg("threads"), nb::arg("progress").none());
  module.def("export", &export_file, nb::arg("path"), nb::arg("output"), nb::arg("format"),
             nb::arg("grid_levels"), nb::arg("low"), nb::arg("high"), nb::arg("memory"),
             nb::arg("gray"), nb::arg("progress").none());
  module.def("export_paths", &export_paths, nb::arg("format"), nb::arg("output"));
  module.def("export_formats", &export_formats);
}

}  // namespace voxdag::python
