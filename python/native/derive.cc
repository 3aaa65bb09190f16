#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "core/fields/json_fields.h"
#include "core/format/global/open_global.h"
#include "core/io/file_system.h"
#include "python/native/bindings.h"
#include "python/native/color_argument.h"
#include "python/native/long_work.h"
#include "python/native/memory.h"
#include "python/native/path_text.h"
#include "query/combine/combine.h"
#include "query/export/export.h"
#include "query/extract/extract.h"
#include "query/reorder/reorder.h"

namespace voxdag::python {
namespace {

using Corner = std::array<int64_t, 3>;

std::string corner_text(const Corner& corner) {
  return std::to_string(corner[0]) + " " + std::to_string(corner[1]) + " " +
         std::to_string(corner[2]);
}

query::Selection selection_of(uint32_t grid_levels, const Corner& low, const Corner& high) {
  const query::Selection selection{grid_levels, query::cut_to_grid({low, high}, grid_levels)};
  if (selection.region.empty())
    throw Error(ErrorCode::kInvalidInput,
                "the region from " + corner_text(low) + " to " + corner_text(high) +
                    " is outside the grid of 2^" + std::to_string(grid_levels) +
                    " cells per edge: expected a region that overlaps the grid");
  return selection;
}

std::string extract(const PathText& path, const PathText& output, uint32_t grid_levels,
                    const Corner& low, const Corner& high, bool crop, bool majority,
                    const std::string& memory, unsigned threads, bool replace,
                    nb::object progress) {
  query::ExtractSpec spec;
  spec.selection = selection_of(grid_levels, low, high);
  spec.crop = crop;
  spec.majority = majority;
  spec.output = output.bytes;
  spec.replace = replace;
  spec.memory_bytes = memory_of(memory);
  spec.threads = threads ? threads : default_threads();
  return run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    const auto file = open_global_file(path.bytes);
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

std::string export_file(const PathText& path, const PathText& output, const std::string& format,
                        uint32_t grid_levels, const Corner& low, const Corner& high,
                        const std::string& memory, bool gray, bool replace,
                        const std::string& options_text, nb::object progress) {
  query::ExportRequest request;
  set_options(FieldJson::parse(options_text), "the options", request.options);
  request.gray = gray;
  request.replace = replace;
  request.format = &query::export_format(format);
  request.selection = selection_of(grid_levels, low, high);
  request.output = output.bytes;
  request.memory_bytes = memory_of(memory);
  return run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    const auto file = open_global_file(path.bytes);
    const query::ExportReport report =
        query::export_dag(system_files(), *file, request, relay, cancel);
    return nlohmann::json{{"bytes", report.bytes},
                          {"voxels", report.voxels},
                          {"notes", report.notes},
                          {"facts", nlohmann::json(query::facts_json(report))}}
        .dump();
  });
}

query::Operation operation_named(const std::string& name) {
  constexpr std::pair<const char*, query::Operation> kOperations[] = {
      {"union", query::Operation::kUnion},
      {"minus", query::Operation::kMinus},
      {"and", query::Operation::kAnd},
      {"xor", query::Operation::kXor}};
  for (const auto& [known, operation] : kOperations)
    if (name == known) return operation;
  throw Error(ErrorCode::kInvalidInput,
              "operation '" + name + "': expected union, minus, and, or xor");
}

void combine(const PathText& a, const PathText& b, const std::string& operation,
             const PathText& output, const std::optional<Corner>& offset, bool clip,
             const std::optional<std::array<uint8_t, 3>>& fill_color, uint64_t color_resolution,
             bool no_attributes, const std::string& memory, unsigned threads, bool replace,
             nb::object progress) {
  query::CombineSpec spec;
  spec.operation = operation_named(operation);
  spec.output = output.bytes;
  spec.offset = offset;
  spec.clip = clip;
  spec.fill_color = rgb_of(fill_color);
  spec.color_resolution = color_resolution;
  spec.attributes = !no_attributes;
  spec.replace = replace;
  spec.memory_bytes = memory_of(memory);
  spec.threads = threads ? threads : default_threads();
  run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    const auto file_a = open_global_file(a.bytes), file_b = open_global_file(b.bytes);
    return query::combine(*file_a, *file_b, spec, system_files(), relay, cancel);
  });
}

NodeOrder node_order_named(const std::string& name) {
  for (const NodeOrder order : {NodeOrder::kByFirstParent, NodeOrder::kByHash})
    if (name == name_of(order)) return order;
  throw Error(ErrorCode::kInvalidInput, "order '" + name + "': expected first-parent or hash");
}

std::string reorder(const PathText& path, const PathText& output, const std::string& order,
                    const std::string& memory, unsigned threads, bool replace,
                    nb::object progress) {
  query::ReorderSpec spec;
  spec.order = node_order_named(order);
  spec.output = output.bytes;
  spec.replace = replace;
  spec.memory_bytes = memory_of(memory);
  spec.threads = threads ? threads : default_threads();
  return run_long_work(std::move(progress), [&](Progress& relay, const CancelToken& cancel) {
    const auto file = open_global_file(path.bytes);
    const query::ReorderReport report = query::reorder(*file, spec, system_files(), relay, cancel);
    return nlohmann::json{{"node_order", order},
                          {"dag_nodes", file->dag_nodes()},
                          {"bytes", report.bytes},
                          {"sha256", report.sha256}}
        .dump();
  });
}

// Returns the paths of the files that an export to `output` writes. Some formats write several
// files.
std::vector<PathText> export_paths(const std::string& format, const PathText& output) {
  std::vector<PathText> paths;
  for (std::string& path : query::export_paths(query::export_format(format), output.bytes))
    paths.push_back({std::move(path)});
  return paths;
}

// Returns the name, the summary and the required suffix ("" if none) of each export format.
std::vector<std::tuple<std::string, std::string, std::string>> export_formats() {
  std::vector<std::tuple<std::string, std::string, std::string>> formats;
  for (const query::ExportFormat& format : query::export_formats())
    formats.emplace_back(format.name, format.summary, format.suffix ? format.suffix : "");
  return formats;
}

}  // namespace

void bind_derive(nb::module_& module) {
  module.def("extract", &extract, nb::arg("path"), nb::arg("output"), nb::arg("grid_levels"),
             nb::arg("low"), nb::arg("high"), nb::arg("crop"), nb::arg("majority"),
             nb::arg("memory"), nb::arg("threads"), nb::arg("replace"), nb::arg("progress").none());
  module.def("export", &export_file, nb::arg("path"), nb::arg("output"), nb::arg("format"),
             nb::arg("grid_levels"), nb::arg("low"), nb::arg("high"), nb::arg("memory"),
             nb::arg("gray"), nb::arg("replace"), nb::arg("options"), nb::arg("progress").none());
  module.def("combine", &combine, nb::arg("a"), nb::arg("b"), nb::arg("operation"),
             nb::arg("output"), nb::arg("offset").none(), nb::arg("clip"),
             nb::arg("fill_color").none(), nb::arg("color_resolution"), nb::arg("no_attributes"),
             nb::arg("memory"), nb::arg("threads"), nb::arg("replace"), nb::arg("progress").none());
  module.def("reorder", &reorder, nb::arg("path"), nb::arg("output"), nb::arg("order"),
             nb::arg("memory"), nb::arg("threads"), nb::arg("replace"), nb::arg("progress").none());
  module.def("export_paths", &export_paths, nb::arg("format"), nb::arg("output"));
  module.def("export_formats", &export_formats);
}

}  // namespace voxdag::python
