// Writes VTK's unstructured grid as XML with appended raw data: a hexahedron for each voxel, and a
// cell array for each attribute. Format: "VTK XML Formats", docs.vtk.org.
#include <array>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "query/export/attribute_cursor.h"
#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/export/mesh/hex_mesh.h"

namespace voxdag::query {
namespace {

// Many readers count points and cells in signed 32-bit integers.
constexpr uint64_t kMaxVtuNumbers = (uint64_t{1} << 31) - 1;
constexpr uint8_t kVtkHexahedron = 12;

const char* vtk_type(NumberType number) {
  switch (number) {
    case NumberType::kUint8:
      return "UInt8";
    case NumberType::kUint32:
      return "UInt32";
    case NumberType::kFloat:
      break;
  }
  return "Float32";
}

// An array in the appended data, where its size in bytes precedes its numbers.
struct VtuArray {
  uint64_t offset = 0;  // from the beginning of the appended data
  uint64_t bytes = 0;   // size of the numbers
  uint64_t written = 0;
};

// The arrays of a mesh in the order of the file. The attributes' arrays follow.
enum : size_t { kPoints, kConnectivity, kOffsets, kTypes, kAttributes };
constexpr std::string_view kVtuEnd = "\n</AppendedData>\n</VTKFile>\n";

// The part of the file before the appended data, and the places of the arrays.
struct VtuLayout {
  VtuLayout(uint64_t points, uint64_t cells, std::span<const AttributeCursor> attributes) {
    xml =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
        "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<UnstructuredGrid>\n"
        "<Piece NumberOfPoints=\"" +
        std::to_string(points) + "\" NumberOfCells=\"" + std::to_string(cells) + "\">\n<Points>\n";
    add("Float64", "Points", 3, points * 3 * sizeof(double));
    xml += "</Points>\n<Cells>\n";
    add("Int64", "connectivity", 1, cells * 8 * sizeof(int64_t));
    add("Int64", "offsets", 1, cells * sizeof(int64_t));
    add("UInt8", "types", 1, cells);
    xml += "</Cells>\n<CellData>\n";
    for (const AttributeCursor& attribute : attributes)
      add(vtk_type(attribute.encoding().number), attribute.traits().plural,
          attribute.encoding().components, cells * attribute.encoding().decoded_bytes());
    xml += "</CellData>\n</Piece>\n</UnstructuredGrid>\n<AppendedData encoding=\"raw\">\n_";
  }
  uint64_t file_bytes() const { return xml.size() + data_bytes + kVtuEnd.size(); }

  std::string xml;
  std::vector<VtuArray> arrays;
  uint64_t data_bytes = 0;  // size of the appended data

 private:
  void add(const char* type, const char* name, uint32_t components, uint64_t bytes) {
    xml += std::string("<DataArray type=\"") + type + "\" Name=\"" + name +
           "\" NumberOfComponents=\"" + std::to_string(components) +
           "\" format=\"appended\" offset=\"" + std::to_string(data_bytes) + "\"/>\n";
    arrays.push_back({data_bytes, bytes, 0});
    data_bytes += sizeof(uint64_t) + bytes;
  }
};

class VtuFile {
 public:
  VtuFile(const ExportJob& job, VtuLayout layout)
      : job_(job), layout_(std::move(layout)), file_(job.files, job.output) {
    file_.write(layout_.xml);
    for (const VtuArray& array : layout_.arrays) {
      file_.seek(layout_.xml.size() + array.offset);
      file_.put(array.bytes);
    }
  }

  // Moves the write position to the place of the array's next number.
  void seek(size_t array) {
    const VtuArray& to = layout_.arrays[array];
    file_.seek(layout_.xml.size() + to.offset + sizeof(uint64_t) + to.written);
  }
  // Appends a number to the array. The last call of seek() must have been for this array.
  template <class Number>
  void put(size_t array, Number number) {
    file_.put(number);
    layout_.arrays[array].written += sizeof(Number);
  }
  uint64_t finish() {
    for (const VtuArray& array : layout_.arrays) require_written(job_, array.written, array.bytes);
    file_.seek(layout_.xml.size() + layout_.data_bytes);
    file_.write(kVtuEnd);
    ExportFile* const written[] = {&file_};
    return publish(job_, written);
  }

 private:
  const ExportJob& job_;
  VtuLayout layout_;
  ExportFile file_;
};

void put_slab(const ExportJob& job, const HexSweep& slab, std::span<AttributeCursor> attributes,
              VtuFile& file, ExportStage& stage) {
  file.seek(kPoints);
  slab.for_each_point([&](const Position& point) {
    for (size_t axis = 0; axis < 3; ++axis)
      file.put(kPoints, job.world(axis, static_cast<double>(point[axis])));
  });
  file.seek(kConnectivity);
  slab.for_each_cell([&](const Position&, const std::array<uint64_t, 8>& points) {
    for (const uint64_t point : points) file.put(kConnectivity, static_cast<int64_t>(point));
    stage.advance(1);
  });
  for (size_t i = 0; i < attributes.size(); ++i) {
    file.seek(kAttributes + i);
    slab.for_each_cell([&](const Position& cell, const std::array<uint64_t, 8>&) {
      attributes[i].put(cell, [&](auto number) { file.put(kAttributes + i, number); });
    });
  }
}

void put_types(uint64_t cells, VtuFile& file) {
  file.seek(kOffsets);
  for (uint64_t i = 1; i <= cells; ++i) file.put(kOffsets, static_cast<int64_t>(8 * i));
  file.seek(kTypes);
  for (uint64_t i = 0; i < cells; ++i) file.put(kTypes, kVtkHexahedron);
}

}  // namespace

ExportReport write_vtu(const ExportJob& job) {
  const HexMesh mesh = require_hex_mesh(job, kMaxVtuNumbers, "readers of .vtu take");
  const uint64_t cells = mesh.slabs.voxels;
  std::vector<AttributeCursor> attributes = exported_attributes(job);
  VtuLayout layout(mesh.points, cells, attributes);
  require_space(job, layout.file_bytes());
  VtuFile file(job, std::move(layout));
  {
    ExportStage stage(job, "export", cells, "voxels");
    for (HexSweep sweep(job, mesh.slabs); sweep.next();)
      put_slab(job, sweep, attributes, file, stage);
    put_types(cells, file);
  }
  ExportReport report;
  report.voxels = cells;
  report.bytes = file.finish();
  report.notes.push_back(hex_mesh_note(mesh));
  report.add_fact("points", mesh.points);
  return report;
}

}  // namespace voxdag::query
