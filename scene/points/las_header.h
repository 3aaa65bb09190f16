// The header of a LAS file (ASPRS LAS 1.1 to 1.4, public header block): the place and layout of the
// point records. All numbers in a LAS file are little-endian.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "core/io/file_system.h"
#include "scene/load_number.h"

namespace voxdag::points {

struct LasHeader {
  static constexpr size_t kNoColor = 0;

  uint8_t minor_version = 0;
  uint8_t point_format = 0;        // 0 to 10
  uint64_t data_begin = 0;         // offset of the first record
  uint64_t record_bytes = 0;       // size of a record, extra bytes included
  uint64_t records = 0;            // number of records, withheld ones included
  size_t color_offset = kNoColor;  // offset of red, green and blue in a record, 16 bits each
  // A coordinate is integer * scale + offset, in doubles.
  std::array<double, 3> scale{}, offset{};

  // True if a record has the flag "withheld": the point is deleted.
  bool is_withheld(const std::byte* record) const {
    const auto flags = std::to_integer<unsigned>(record[15]);
    return (point_format < 6 ? flags >> 7 & 1 : flags >> 2 & 1) != 0;
  }
};

// True if the file begins with "LASF", compressed or not.
bool is_las(const ReadableFile& file);

// Reads and checks the header. Throws Error{kInvalidInput} with the field, the value found and the
// value expected. A compressed file (LAZ) is refused.
LasHeader read_las_header(const ReadableFile& file);

}  // namespace voxdag::points
