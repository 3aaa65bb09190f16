// Builds small LAS files for tests.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace voxdag::test {

struct LasPoint {
  std::array<int32_t, 3> xyz{};
  std::array<uint16_t, 3> rgb{};
  bool is_withheld = false;
};

struct LasBuilder {
  uint8_t minor = 2;
  uint8_t format = 0;
  uint16_t extra_bytes = 0;
  std::array<double, 3> scale{0.01, 0.01, 0.01}, offset{};
  std::string between;  // variable length records between the header and the points
  std::string behind;   // bytes after the points
  std::vector<LasPoint> points;
  bool has_old_count = true, has_new_count = true;

  uint16_t record_bytes() const {
    constexpr uint16_t kBytes[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
    return static_cast<uint16_t>(kBytes[format] + extra_bytes);
  }
  uint16_t header_bytes() const { return minor >= 4 ? 375 : minor == 3 ? 235 : 227; }

  template <class T>
  static void put(std::string& bytes, size_t at, T value) {
    std::memcpy(&bytes[at], &value, sizeof(T));
  }

  std::string file() const {
    std::string header(header_bytes(), '\0');
    header.replace(0, 4, "LASF");
    put<uint8_t>(header, 24, 1);
    put<uint8_t>(header, 25, minor);
    put<uint16_t>(header, 94, header_bytes());
    put<uint32_t>(header, 96, static_cast<uint32_t>(header.size() + between.size()));
    put<uint8_t>(header, 104, format);
    put<uint16_t>(header, 105, record_bytes());
    if (has_old_count) put<uint32_t>(header, 107, static_cast<uint32_t>(points.size()));
    for (size_t a = 0; a < 3; ++a) put(header, 131 + 8 * a, scale[a]);
    for (size_t a = 0; a < 3; ++a) put(header, 155 + 8 * a, offset[a]);
    if (minor >= 4 && has_new_count) put<uint64_t>(header, 247, points.size());
    std::string all = header + between;
    for (const LasPoint& point : points) all += record(point);
    return all + behind;
  }

  std::string record(const LasPoint& point) const {
    constexpr size_t kColor[] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};
    std::string record(record_bytes(), '\xFF');  // all other members have all bits set
    for (size_t a = 0; a < 3; ++a) put(record, 4 * a, point.xyz[a]);
    const uint8_t withheld = format < 6 ? 0x80 : 0x04;
    put<uint8_t>(record, 15, static_cast<uint8_t>(point.is_withheld ? 0xFF : 0xFF & ~withheld));
    if (kColor[format] > 0)
      for (size_t c = 0; c < 3; ++c) put(record, kColor[format] + 2 * c, point.rgb[c]);
    return record;
  }
};

}  // namespace voxdag::test
