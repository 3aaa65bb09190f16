// The colors of regions as the artifacts of the color stage hold them: records, one after another
// (docs/format.md, "Stored colors").
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/color/blocks/region.h"
#include "core/format/bytes.h"

namespace voxdag {

void append_region(const EncodedRegion& region, std::vector<std::byte>& out);

// Takes records from the front of bytes, which append_region() wrote. What they were read from has
// a checksum; what is wrong nevertheless is reported.
class RegionRecords {
 public:
  explicit RegionRecords(std::span<const std::byte> bytes) : in_(bytes) {}
  // The next region; nothing after the last one. Throws Error{kCorrupt} for bytes that are no
  // record.
  std::optional<EncodedRegion> next();

 private:
  ByteSource in_;
};

}  // namespace voxdag
