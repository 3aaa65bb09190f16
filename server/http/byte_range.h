// The Range header (RFC 9110, section 14) for what has a known size.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace voxdag::server {

// Bytes [begin, end), not empty.
struct ByteRange {
  uint64_t begin = 0;
  uint64_t end = 0;
  uint64_t size() const { return end - begin; }
  bool operator==(const ByteRange&) const = default;
};

struct RangeAnswer {
  enum class Kind {
    kWhole,          // no range is asked for, or not in a way that is to be honored: 200
    kPart,           // 206
    kUnsatisfiable,  // 416
  };
  Kind kind = Kind::kWhole;
  std::vector<ByteRange> ranges;  // of kPart, in the order asked for
};

// `size` > 0. A header that breaks the grammar, has another unit, or asks for more than 16 ranges,
// or more bytes than there are, is answered with the whole. Ranges that
// lie outside are dropped; if none is left it is unsatisfiable.
RangeAnswer parse_ranges(std::string_view header, uint64_t size);

// "bytes FIRST-LAST/TOTAL" of a request that sends a part. False if it is not that, or not
// FIRST <= LAST < TOTAL.
bool parse_content_range(std::string_view header, ByteRange& range, uint64_t& total);

}  // namespace voxdag::server
