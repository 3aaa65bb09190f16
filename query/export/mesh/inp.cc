// Writes an input file of Abaqus and CalculiX: nodes, and elements of the type C3D8. The labels of
// nodes and elements begin at 1. Coordinates have 12 digits, because CalculiX reads at most 20
// characters of a number.
#include <array>
#include <charconv>
#include <string>

#include "query/export/export_file.h"
#include "query/export/export_job.h"
#include "query/export/mesh/hex_mesh.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kMaxInpLabel = 999'999'999;  // the maximum of Abaqus
constexpr int kInpDigits = 12;
constexpr const char* kInpSet = "VOXELS";
// Minimum sizes in bytes of the lines of a node and of an element. A line has four or nine numbers
// of at least one digit, and a comma or a line end after each number.
constexpr uint64_t kMinNodeBytes = 8;
constexpr uint64_t kMinElementBytes = 18;

// A line of numbers with commas between them.
class InpLine {
 public:
  InpLine& label(uint64_t value) {
    return append([&](char* at, char* end) { return std::to_chars(at, end, value); });
  }
  InpLine& coordinate(double value) {
    return append([&](char* at, char* end) {
      return std::to_chars(at, end, value, std::chars_format::general, kInpDigits);
    });
  }
  void write(ExportFile& file) {
    text_[size_ - 1] = '\n';  // instead of the last comma
    file.write(std::string_view(text_.data(), size_));
    size_ = 0;
  }

 private:
  template <class Convert>
  InpLine& append(const Convert& convert) {
    char* const end = convert(text_.data() + size_, text_.data() + text_.size() - 1).ptr;
    *end = ',';
    size_ = static_cast<size_t>(end - text_.data()) + 1;
    return *this;
  }
  std::array<char, 256> text_;
  size_t size_ = 0;
};

void put_nodes(const ExportJob& job, const HexMesh& mesh, ExportFile& file) {
  file.write("*NODE, NSET=" + std::string(kInpSet) + "\n");
  ExportStage stage(job, "write nodes", mesh.points, "nodes");
  uint64_t label = 0;
  InpLine line;
  for (HexSweep sweep(job, mesh.slabs); sweep.next();)
    sweep.for_each_point([&](const Position& point) {
      line.label(++label);
      for (size_t axis = 0; axis < 3; ++axis)
        line.coordinate(job.world(axis, static_cast<double>(point[axis])));
      line.write(file);
      stage.advance(1);
    });
  require_written(job, label, mesh.points);
}

void put_elements(const ExportJob& job, const HexMesh& mesh, ExportFile& file) {
  file.write("*ELEMENT, TYPE=C3D8, ELSET=" + std::string(kInpSet) + "\n");
  ExportStage stage(job, "export", mesh.slabs.voxels, "voxels");
  uint64_t label = 0;
  InpLine line;
  for (HexSweep sweep(job, mesh.slabs); sweep.next();)
    sweep.for_each_cell([&](const Position&, const std::array<uint64_t, 8>& points) {
      line.label(++label);
      for (const uint64_t point : points) line.label(point + 1);
      line.write(file);
      stage.advance(1);
    });
  require_written(job, label, mesh.slabs.voxels);
}

}  // namespace

ExportReport write_inp(const ExportJob& job) {
  const HexMesh mesh = require_hex_mesh(job, kMaxInpLabel, "Abaqus has labels for");
  require_space(job, mesh.points * kMinNodeBytes + mesh.slabs.voxels * kMinElementBytes);
  ExportReport report;
  report.voxels = mesh.slabs.voxels;
  ExportFile file(job.files, job.output);
  file.write("*HEADING\nvoxels by voxdag, in scene units\n");
  put_nodes(job, mesh, file);
  put_elements(job, mesh, file);
  ExportFile* const written[] = {&file};
  report.bytes = publish(job, written);
  report.notes.push_back(hex_mesh_note(mesh));
  report.add_fact("points", mesh.points);
  report.notes.emplace_back(
      "all nodes and all elements are in the sets VOXELS; materials, loads and boundary conditions "
      "are yours to add");
  return report;
}

}  // namespace voxdag::query
