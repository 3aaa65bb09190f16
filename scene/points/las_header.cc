#include "scene/points/las_header.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/integers.h"
#include "core/base/text.h"
#include "scene/messages.h"

namespace voxdag::points {
namespace {

constexpr size_t kLasHeaderBytes = 227;    // LAS 1.1 and 1.2
constexpr size_t kLas14HeaderBytes = 375;  // LAS 1.4, which has 64-bit counts

// Size of a record without extra bytes, and offset of its colors, for each point format.
struct RecordLayout {
  uint16_t bytes;
  uint16_t color_offset;
};
constexpr RecordLayout kRecordLayouts[] = {
    {20, 0}, {28, 0},  {26, 20}, {34, 28}, {57, 0},  {63, 28},
    {30, 0}, {36, 30}, {38, 30}, {59, 0},  {67, 30},
};

class LasHeaderParser {
 public:
  explicit LasHeaderParser(const ReadableFile& file)
      : file_(file), bytes_(std::min<uint64_t>(file.size(), kLas14HeaderBytes)) {
    file.read_at(0, bytes_);
    if (bytes_.size() < kLasHeaderBytes)
      refuse("ends within its LAS header: it has " + std::to_string(file.size()) +
             " bytes, expected " + std::to_string(kLasHeaderBytes) + " or more");
  }

  LasHeader parse() {
    LasHeader header;
    header.minor_version = read_version();
    const uint64_t header_bytes = read_header_bytes(header.minor_version);
    read_format(header);
    header.data_begin = at<uint32_t>(96);
    if (header.data_begin < header_bytes || header.data_begin > file_.size())
      refuse("its LAS header gives the offset " + std::to_string(header.data_begin) +
             " of the point data, expected " + std::to_string(header_bytes) + " (the header) to " +
             std::to_string(file_.size()) + " (the file)");
    header.records = read_count(header.minor_version);
    read_placement(header);
    check_end(header);
    return header;
  }

 private:
  template <class T>
  T at(size_t offset) const {
    return load_little_endian<T>(&bytes_[offset]);
  }

  uint8_t read_version() const {
    const auto major = at<uint8_t>(24), minor = at<uint8_t>(25);
    if (major != 1 || minor < 1 || minor > 4)
      refuse("is LAS version " + std::to_string(major) + "." + std::to_string(minor) +
             ", expected 1.1 to 1.4");
    return minor;
  }

  uint64_t read_header_bytes(uint8_t minor) const {
    const uint64_t stored = at<uint16_t>(94);
    const uint64_t least = minor >= 4 ? kLas14HeaderBytes : kLasHeaderBytes;
    if (stored < least || bytes_.size() < least)
      refuse("its LAS header has " + std::to_string(std::min<uint64_t>(stored, file_.size())) +
             " bytes, expected " + std::to_string(least) + " or more");
    return stored;
  }

  void read_format(LasHeader& header) const {
    const auto stored = at<uint8_t>(104);
    // LASzip sets the high bits of the point format.
    if ((stored & 0xC0) != 0)
      refuse(
          "is a compressed LAZ file, which only voxdag's Python package reads; convert it to LAS "
          "first: in Python, laspy.read(\"x.laz\").write(\"x.las\"), with pip install "
          "laspy[lazrs]");
    if (stored >= std::size(kRecordLayouts))
      refuse("its LAS header gives the point format " + std::to_string(stored) +
             ", expected 0 to 10");
    const RecordLayout& layout = kRecordLayouts[stored];
    header.point_format = stored;
    header.color_offset = layout.color_offset;
    header.record_bytes = at<uint16_t>(105);
    if (header.record_bytes < layout.bytes)
      refuse("its LAS header gives records of " + std::to_string(header.record_bytes) +
             " bytes, expected " + std::to_string(layout.bytes) + " or more for point format " +
             std::to_string(stored));
  }

  // Returns the number of point records. LAS 1.4 has a 64-bit count, but some programs set only the
  // older 32-bit count.
  uint64_t read_count(uint8_t minor) const {
    const uint64_t old_count = at<uint32_t>(107);
    const uint64_t count = minor >= 4 ? at<uint64_t>(247) : old_count;
    return count > 0 ? count : old_count;
  }

  void read_placement(LasHeader& header) const {
    for (size_t a = 0; a < 3; ++a) {
      const std::string axis(1, "XYZ"[a]);
      header.scale[a] = at<double>(131 + 8 * a);
      header.offset[a] = at<double>(155 + 8 * a);
      if (!std::isfinite(header.scale[a]) || header.scale[a] == 0)
        refuse("its LAS header has the scale factor " + number_text(header.scale[a]) + " of " +
               axis + ", expected a finite number other than 0");
      if (!std::isfinite(header.offset[a]))
        refuse("its LAS header has the offset " + number_text(header.offset[a]) + " of " + axis +
               ", expected a finite number");
    }
  }

  void check_end(const LasHeader& header) const {
    const uint128 end =
        header.data_begin + static_cast<uint128>(header.records) * header.record_bytes;
    if (end > file_.size())
      refuse("its " + std::to_string(header.records) + " LAS points of " +
             std::to_string(header.record_bytes) + " bytes each begin at byte " +
             std::to_string(header.data_begin) + " and end past the " +
             std::to_string(file_.size()) + " bytes of the file");
  }

  [[noreturn]] void refuse(const std::string& what) const { voxdag::refuse(file_.path(), what); }

  const ReadableFile& file_;
  std::vector<std::byte> bytes_;
};

}  // namespace

bool is_las(const ReadableFile& file) {
  std::array<char, 4> first{};
  if (file.size() < first.size()) return false;
  file.read_at(0, std::as_writable_bytes(std::span(first)));
  return std::string_view(first.data(), first.size()) == "LASF";
}

LasHeader read_las_header(const ReadableFile& file) { return LasHeaderParser(file).parse(); }

}  // namespace voxdag::points
