// Writes a finished DAG, or a part of it, in the formats of other programs. docs/export.md lists
// the programs that read each format. If a format cannot hold the data, the export fails, usually
// before anything is written.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/progress.h"
#include "core/fields/field.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "query/dag/selection.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct ExportJob;

struct ExportReport {
  std::vector<std::string> files;  // all written files; the requested file is first
  uint64_t bytes = 0;              // total size of all files
  uint64_t voxels = 0;
  std::vector<std::string> notes;  // usage notes for the files, one sentence each
  // The numbers in the notes, by name: a single number, or the three coordinates of a position.
  std::vector<std::pair<std::string, std::vector<double>>> facts;

  void add_fact(const char* name, double number) { facts.push_back({name, {number}}); }
  void add_fact(const char* name, uint64_t number) { add_fact(name, static_cast<double>(number)); }
};

// Returns the facts of the report as a JSON object. The value of a fact is a number or a list of
// numbers. Whole numbers are written as integers.
nlohmann::ordered_json facts_json(const ExportReport& report);

// The axis of the exported file along which the y axis of the .vdag file points. kOfFormat is the
// default of the format.
enum class UpAxis { kOfFormat, kY, kZ };
constexpr std::array<const char*, 3> enum_names(UpAxis) { return {"", "y", "z"}; }

// The kind of a grid of voxels in a vdb or nvdb file. kOfFormat means kDensity.
enum class GridKind { kOfFormat, kDensity, kMask, kSdf };
constexpr std::array<const char*, 4> enum_names(GridKind) { return {"", "density", "mask", "sdf"}; }

inline constexpr int kMaxExportBand = 16;

// All formats have the option `up`; only some formats have the other options.
struct ExportOptions {
  UpAxis up = UpAxis::kOfFormat;
  GridKind grid = GridKind::kOfFormat;  // only for vdb and nvdb
  std::optional<int> band;  // with GridKind::kSdf: half width of the band, in voxels; default 3
  bool compact = false;     // npz: leave out arrays that can be computed from the others
  bool outside = false;     // glb: only faces that are visible from outside
  bool watertight = false;  // glb: a closed mesh without T-junctions (surface_mesh.h)

  int band_width() const { return band.value_or(3); }
};

// The description from which the options of the command line, the service and Python derive.
template <class Visitor>
void fields(Visitor& visit, ExportOptions& options) {
  visit(Field("up", "axis of the exported file that gets the y axis of the scene")
            .unset_means("z for vox, otherwise y"),
        options.up);
  visit(Field("grid",
              "vdb, nvdb: density, a fog volume; mask, which is smaller; or sdf, the distance to "
              "the surface of a solid")
            .unset_means("density"),
        options.grid);
  visit(Field("band", "vdb, nvdb with the grid sdf: distances up to this number of voxels")
            .range(1, kMaxExportBand)
            .unset_means("3"),
        options.band);
  visit(Field("compact", "npz: leave out the arrays that can be computed from the others"),
        options.compact);
  visit(Field("outside",
              "glb: write only the faces that are visible from outside, not those around enclosed "
              "space"),
        options.outside);
  visit(
      Field("watertight", "glb: write a closed mesh: triangles meet at common edges and vertices"),
      options.watertight);
}

struct ExportFormat {
  const char* name;
  const char* summary;  // description in the list of formats
  // Required suffix of the output's name; null if the format requires none. In a format of two
  // files, the second file's name has `second_suffix` instead of `suffix`.
  const char* suffix;
  const char* second_suffix;
  ExportReport (*write)(const ExportJob& job);
  UpAxis up = UpAxis::kY;  // the axis that kOfFormat means
  // Names of the other options (ExportOptions) of the format, each after a space: " grid band".
  const char* options = "";
};

// Returns the formats that this build of voxdag supports. A format that needs a missing library is
// absent.
std::span<const ExportFormat> export_formats();
// Returns the format with this name. If no format has it, throws Error{kInvalidInput} with the list
// of all names.
const ExportFormat& export_format(const std::string& name);
// Returns the names of all files of an export. Throws Error{kInvalidInput} if `output` does not
// have the suffix that the format needs.
std::vector<std::string> export_paths(const ExportFormat& format, const std::string& output);

// Throws FieldError if `options` has a value for an option that the format does not have, or an
// invalid band.
void check_export_options(const ExportFormat& format, const ExportOptions& options);

struct ExportRequest {
  const ExportFormat* format = nullptr;
  Selection selection;
  std::string output;
  uint64_t memory_bytes = 0;  // limit of allocations, not including the mapped file
  bool gray = false;          // no colors in the output
  bool replace = false;       // replace existing files
  ExportOptions options{};
};

// Writes the selected voxels. The files get their final names when all of them are complete. After
// an error no file remains, with one exception: if the rename of the second of two files fails, the
// first file remains. If the process is killed, the next export to the same output removes its
// files. Throws Error{kLimit} if the format cannot hold the voxels, Error{kOutOfMemory} if they do
// not fit in memory_bytes (the message names a selection that fits), and the errors of
// LockedOutputs (query/dag/locked_outputs.h).
ExportReport export_dag(FileSystem& files, const voxdag_reader::File& file,
                        const ExportRequest& request, Progress& progress,
                        const CancelToken& cancel);

}  // namespace voxdag::query
