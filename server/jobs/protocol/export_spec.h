// A client's request to export a part of a job's result: the body of POST /jobs/{id}/exports. The
// options are those of `voxdag export` for one file (without --chunks) and of `voxdag extract`,
// which the format "vdag" selects.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/fields/field.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/selection.h"
#include "query/export/export.h"

namespace voxdag::server {

struct ExportSpec {
  std::string to;
  std::optional<uint32_t> level;
  std::optional<std::array<double, 6>> region;
  bool world = false;
  bool gray = false;
  query::ExportOptions options;
  bool crop = false, majority = false;

  // True if the file to write is a .vdag file.
  bool is_extract() const { return to == "vdag"; }
};

template <class Visitor>
void fields(Visitor& visit, ExportSpec& spec) {
  visit(Field("to", "the format: vdag, or a format of `voxdag export`").line(20).required(),
        spec.to);
  visit(Field("level", "l: the coarser grid of 2^l voxels per edge").range(2, 20), spec.level);
  visit(Field("region", "a half-open box in voxels of the grid that `level` selects")
            .with(&Field::parts, "X0,Y0,Z0,X1,Y1,Z1"),
        spec.region);
  visit(Field("world", "the region is in scene units"), spec.world);
  visit(Field("gray", "leave out the colors that the result may have"), spec.gray);
  fields(visit, spec.options);
  visit(Field("crop", "vdag: make the smallest octree cube around the region the new grid"),
        spec.crop);
  visit(Field("majority",
              "vdag: set a cell of a coarser level if at least half of its voxels are set"),
        spec.majority);
}

// Returns the formats that `to` accepts.
std::vector<std::string> export_spec_formats();
// Throws RequestError{kInvalid} for an unknown format or a wrong region, and FieldError for an
// option that the format does not have.
void check_export_spec(const ExportSpec& spec);
// Parses and checks the body of the request. Throws RequestError{kInvalid}.
ExportSpec parse_export_spec(std::string_view body);
// Returns a JSON text of the options that differ from their defaults. The text is equal for equal
// requests, and parse_export_spec() can read it.
std::string export_spec_text(const ExportSpec& spec);

// Returns the selected part of `file`. Throws RequestError{kInvalid} if the grid of the file has
// fewer levels, or if the region is outside the grid.
query::Selection selection_of(const ExportSpec& spec, const voxdag_reader::File& file);
// Returns the name of the (first) file to write: `stem` with the ending of the format.
std::string export_file_name(const ExportSpec& spec, const std::string& stem);

}  // namespace voxdag::server
