// PLY, binary: the centers of the voxels as doubles, since floats cannot tell the voxels of a large
// grid apart, and their colors and other attributes, if the file has some. The format: Greg Turk,
// "The PLY Polygon File Format", 1994.
#include <bit>
#include <string>
#include <vector>

#include "query/export/color/cell_values.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

// Most readers count vertices in 32-bit integers.
constexpr uint64_t kMaxPlyVertices = (uint64_t{1} << 31) - 1;

const char* properties_of(Attribute attribute) {
  if (attribute == Attribute::kAlpha) return "property uchar alpha\n";
  if (attribute == Attribute::kMaterial) return "property uint material\n";
  return "property float nx\nproperty float ny\nproperty float nz\n";
}

std::string ply_header(uint64_t vertices, bool has_colors, const std::string& more) {
  return "ply\nformat binary_little_endian 1.0\ncomment voxel centers by voxdag\nelement vertex " +
         std::to_string(vertices) + "\nproperty double x\nproperty double y\nproperty double z\n" +
         (has_colors ? "property uchar red\nproperty uchar green\nproperty uchar blue\n" : "") +
         more + "end_header\n";
}

}  // namespace

ExportReport write_ply(const ExportJob& job) {
  ExportReport report;
  report.voxels = require_voxels(job, kMaxPlyVertices, "readers of PLY take");
  const bool has_colors = job.has_colors;
  std::string properties;
  uint64_t bytes = 3 * sizeof(double) + (has_colors ? 3 : 0);  // of a voxel
  std::vector<CellValueCursor> values;
  for (const Attribute attribute : exported_values(job)) {
    properties += properties_of(attribute);
    bytes += exported_bytes(attribute);
    values.emplace_back(job, attribute);
  }
  const std::string header = ply_header(report.voxels, has_colors, properties);
  require_space(job, header.size() + report.voxels * bytes);
  voxdag_reader::ColorCursor colors(job.file);
  ExportFile file(job.files, job.output);
  file.write(header);
  ExportStage stage(job, "export", report.voxels, "voxels");
  uint64_t written_voxels = 0;
  for_each_brick(job.dag, job.selection, [&](const Brick& brick) {
    for_each_cell_of(brick, [&](const Position& cell) {
      for (size_t axis = 0; axis < 3; ++axis)
        file.put(job.world(axis, static_cast<double>(cell[axis]) + 0.5));
      if (has_colors) file.put(color_of_cell(job, colors, cell));
      for (CellValueCursor& value : values) value.put(cell, [&](auto number) { file.put(number); });
    });
    const auto voxels = static_cast<uint64_t>(std::popcount(brick.mask));
    written_voxels += voxels;
    stage.advance(voxels);
  });
  require_written(job, written_voxels, report.voxels);
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  return report;
}

}  // namespace voxdag::query
