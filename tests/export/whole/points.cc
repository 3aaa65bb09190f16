// Decodes PLY and .npz files, which store one position after the other.
#include <map>

#include "tests/export/whole/formats.h"

namespace voxdag::test {
namespace {

// Returns the offset of each array's data by the array's name, in a ZIP archive without
// compression.
std::map<std::string, uint64_t> stored_arrays(const MappedFile& file) {
  std::map<std::string, uint64_t> arrays;
  uint64_t at = 0;
  while (file.get<uint32_t>(at) == 0x04034b50) {
    expect(file.get<uint16_t>(at + 8) == 0, "arrays without compression");
    uint64_t size = file.get<uint32_t>(at + 18);
    const uint16_t name_bytes = file.get<uint16_t>(at + 26), extra = file.get<uint16_t>(at + 28);
    const std::string name = file.text(at + 30, name_bytes);
    if (size == UINT32_MAX) {
      expect(file.get<uint16_t>(at + 30 + name_bytes) == 1, "the sizes of ZIP64");
      size = file.get<uint64_t>(at + 30 + name_bytes + 12);
    }
    at += 30u + name_bytes + extra;
    expect(file.text(at, 6) == std::string("\x93NUMPY", 6), "an array of numpy");
    arrays[name] = at;
    at += size;
  }
  return arrays;
}

// Moves `at` past the header of an array, and returns the header.
std::string npy_description(const MappedFile& file, uint64_t& at) {
  const uint16_t bytes = file.get<uint16_t>(at + 8);
  const std::string header = file.text(at + 10, bytes);
  at += 10u + bytes;
  return header;
}

uint64_t rows_of(const std::string& header, const char* type) {
  expect(header.find(std::string("'descr': '") + type) != std::string::npos, "another type");
  expect(header.find("'fortran_order': False") != std::string::npos, "rows one after the other");
  const size_t shape = header.find("'shape': (") + 10;
  size_t end = 0;
  const uint64_t rows = std::stoull(header.substr(shape), &end);
  expect(header.compare(shape + end, 4, ", 3)") == 0, "three columns");
  return rows;
}

}  // namespace

void digest_ply(const std::string& path, const Grid& grid, Digest& digest) {
  const MappedFile file(path);
  uint64_t at = 0, count = 0, properties = 0;
  std::string line = file.line(at);
  expect(line == "ply" && file.line(at) == "format binary_little_endian 1.0", "binary PLY");
  while ((line = file.line(at)) != "end_header") {
    if (line.starts_with("element vertex "))
      count = std::stoull(line.substr(15));
    else if (line.starts_with("property "))
      expect(line == std::string("property double ") + "xyz"[properties++], "doubles x, y, z");
    else
      expect(line.starts_with("comment "), "vertices alone");
  }
  expect(properties == 3 && file.size() - at == 24 * count, "three doubles for each vertex");
  for (uint64_t i = 0; i < count; ++i, at += 24)
    digest.add(grid.cell(0, file.get<double>(at), 0.5), grid.cell(1, file.get<double>(at + 8), 0.5),
               grid.cell(2, file.get<double>(at + 16), 0.5));
}

void digest_npz(const std::string& path, const Grid& grid, Digest& digest) {
  const MappedFile file(path);
  const auto arrays = stored_arrays(file);
  expect(arrays.size() == 3 && arrays.contains("grid.npy"), "cells, positions and grid");
  uint64_t cells = arrays.at("cells.npy"), positions = arrays.at("positions.npy");
  const uint64_t count = rows_of(npy_description(file, cells), "<i4");
  expect(rows_of(npy_description(file, positions), "<f8") == count, "as many positions as cells");
  for (uint64_t i = 0; i < count; ++i) {
    std::array<int32_t, 3> cell;
    std::memcpy(cell.data(), file.at(cells + 12 * i, 12), 12);
    for (int axis = 0; axis < 3; ++axis)
      expect(grid.cell(axis, file.get<double>(positions + 24 * i + 8 * static_cast<uint64_t>(axis)),
                       0.5) == cell[static_cast<size_t>(axis)],
             "a cell where its position is");
    digest.add(cell[0], cell[1], cell[2]);
  }
}

}  // namespace voxdag::test
