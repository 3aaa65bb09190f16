#include "server/jobs/protocol/export_spec.h"

#include <cmath>

#include "core/base/error.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "server/jobs/protocol/request_body.h"

namespace voxdag::server {
namespace {

constexpr double kMaxCell = 1 << 30;  // maximum coordinate; a region may extend beyond the grid

RequestError invalid_export(const std::string& message) {
  return {RequestError::Kind::kInvalid, message};
}

// Returns the cells of the region, which may extend beyond the grid.
query::Region cells_of(const std::array<double, 6>& box) {
  query::Region region;
  for (size_t axis = 0; axis < 3; ++axis) {
    region.low[axis] = static_cast<int64_t>(box[axis]);
    region.high[axis] = static_cast<int64_t>(box[axis + 3]);
  }
  return region;
}

void check_region(const ExportSpec& spec) {
  if (!spec.region) {
    if (spec.world) throw invalid_export("'world': expected a 'region' in scene units");
    return;
  }
  const auto& box = *spec.region;
  for (const double number : box)
    if (!spec.world && (number != std::floor(number) || std::abs(number) > kMaxCell))
      throw invalid_export(
          "'region': expected six whole numbers X0,Y0,Z0,X1,Y1,Z1, or 'world' for a region in "
          "scene units");
  for (size_t axis = 0; axis < 3; ++axis)
    if (!(box[axis] < box[axis + 3]))
      throw invalid_export("'region': expected X0 < X1, Y0 < Y1 and Z0 < Z1");
}

}  // namespace

std::vector<std::string> export_spec_formats() {
  std::vector<std::string> names = {"vdag"};
  for (const query::ExportFormat& format : query::export_formats()) names.emplace_back(format.name);
  return names;
}

void check_export_spec(const ExportSpec& spec) {
  check_region(spec);
  if (spec.is_extract()) {
    const std::string expectation = "'to' to be a format of voxdag export, not vdag";
    if (spec.gray) throw FieldError("gray", expectation);
    const FieldJson given = options_json(spec.options);
    if (!given.empty()) throw FieldError(given.begin().key(), expectation);
    return;
  }
  const query::ExportFormat* format = nullptr;
  for (const query::ExportFormat& known : query::export_formats())
    if (spec.to == known.name) format = &known;
  if (!format)
    throw invalid_export("'to' is '" + printable_line(spec.to) + "': expected one of " +
                         joined(export_spec_formats()));
  if (spec.crop || spec.majority)
    throw FieldError(spec.crop ? "crop" : "majority", "'to' to be vdag, not " + spec.to);
  query::check_export_options(*format, spec.options);
}

ExportSpec parse_export_spec(std::string_view body) {
  return as_request([&] {
    ExportSpec read;
    read_body(body, read);
    check_export_spec(read);
    return read;
  });
}

std::string export_spec_text(const ExportSpec& spec) { return json_text(options_json(spec)); }

query::Selection selection_of(const ExportSpec& spec, const voxdag_reader::File& file) {
  query::Selection selection;
  selection.grid_levels = spec.level.value_or(file.grid_levels());
  if (selection.grid_levels > file.grid_levels())
    throw invalid_export("'level' is " + std::to_string(selection.grid_levels) +
                         ": expected 2 to " + std::to_string(file.grid_levels()) +
                         ", the level of the result");
  selection.region = query::whole_grid(selection.grid_levels);
  if (!spec.region) return selection;
  selection.region = query::cut_to_grid(
      spec.world ? query::world_to_region(file, selection.grid_levels, *spec.region)
                 : cells_of(*spec.region),
      selection.grid_levels);
  if (selection.region.empty())
    throw invalid_export("'region' is outside the grid of " +
                         std::to_string(int64_t{1} << selection.grid_levels) +
                         " voxels per edge: expected a region that overlaps the grid");
  return selection;
}

std::string export_file_name(const ExportSpec& spec, const std::string& stem) {
  if (!spec.is_extract())
    if (const char* suffix = query::export_format(spec.to).suffix) return stem + suffix;
  return stem + "." + spec.to;
}

}  // namespace voxdag::server
