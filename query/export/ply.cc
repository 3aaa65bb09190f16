// Writes binary PLY: the centers of the voxels, and the attributes of the file. The centers are
// doubles, because floats cannot distinguish the voxels of a large grid. Format: Greg Turk, "The
// PLY Polygon File Format", 1994.
#include <bit>
#include <string>
#include <vector>

#include "query/export/attribute_cursor.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

// Most readers count vertices in signed 32-bit integers.
constexpr uint64_t kMaxPlyVertices = (uint64_t{1} << 31) - 1;

std::string property_lines(const AttributeCursor& attribute) {
  const NumberType number = attribute.encoding().number;
  const char* const type = number == NumberType::kUint8    ? "uchar"
                           : number == NumberType::kUint32 ? "uint"
                                                           : "float";
  std::string lines;
  for (uint32_t i = 0; i < attribute.encoding().components; ++i)
    lines += std::string("property ") + type + " " + attribute.traits().ply_properties[i] + "\n";
  return lines;
}

std::string ply_header(uint64_t vertices, std::span<const AttributeCursor> attributes) {
  std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment voxel centers by voxdag\nelement vertex " +
      std::to_string(vertices) + "\nproperty double x\nproperty double y\nproperty double z\n";
  for (const AttributeCursor& attribute : attributes) header += property_lines(attribute);
  return header + "end_header\n";
}

}  // namespace

ExportReport write_ply(const ExportJob& job) {
  ExportReport report;
  report.voxels = require_voxels(job, kMaxPlyVertices, "readers of PLY take");
  std::vector<AttributeCursor> attributes = exported_attributes(job);
  const std::string header = ply_header(report.voxels, attributes);
  require_space(job,
                header.size() + report.voxels * (3 * sizeof(double) + decoded_bytes(attributes)));
  ExportFile file(job.files, job.output);
  file.write(header);
  ExportStage stage(job, "export", report.voxels, "voxels");
  uint64_t written_voxels = 0;
  for_each_brick(job.dag, job.selection, [&](const Brick& brick) {
    for_each_cell_of(brick, [&](const Position& cell) {
      for (size_t axis = 0; axis < 3; ++axis)
        file.put(job.world(axis, static_cast<double>(cell[axis]) + 0.5));
      for (AttributeCursor& attribute : attributes)
        attribute.put(cell, [&](auto number) { file.put(number); });
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
