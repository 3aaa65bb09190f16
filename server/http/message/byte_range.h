// Range and Content-Range headers (RFC 9110, section 14) for contents of a known size.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace voxdag::server {

// The bytes [begin, end) of the contents. The range is not empty.
struct ByteRange {
  uint64_t begin = 0;
  uint64_t end = 0;
  uint64_t size() const { return end - begin; }
  bool operator==(const ByteRange&) const = default;
};

struct RangeAnswer {
  enum class Kind {
    kWhole,          // 200: no range is requested, or the header is ignored
    kPart,           // 206
    kUnsatisfiable,  // 416
  };
  Kind kind = Kind::kWhole;
  std::vector<ByteRange> ranges;  // for kPart, in the requested order
};

// Resolves a Range header for contents of `size` > 0 bytes. Ignores a malformed header, units other
// than bytes, and a header that requests more than 16 ranges or more than `size` bytes in total.
// Drops ranges outside the contents. If no range remains, the result is kUnsatisfiable.
RangeAnswer parse_ranges(std::string_view header, uint64_t size);

// Parses the Content-Range of an upload, "bytes FIRST-LAST/TOTAL". Returns false unless it is
// well-formed and FIRST <= LAST < TOTAL.
bool parse_content_range(std::string_view header, ByteRange& range, uint64_t& total);

}  // namespace voxdag::server
