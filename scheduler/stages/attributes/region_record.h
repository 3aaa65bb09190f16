// Records of the colors of regions, one after another, as stored in the artifacts of the color
// stage (docs/format.md, "Stored colors").
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/color/blocks/region.h"
#include "core/format/bytes.h"

namespace voxdag {

void append_region(const EncodedRegion& region, std::vector<std::byte>& out);

// Reads records from the front of `bytes`, in the form that append_region() writes. The bytes must
// have passed a checksum; remaining defects throw.
class RegionRecords {
 public:
  explicit RegionRecords(std::span<const std::byte> bytes) : in_(bytes) {}
  // Returns the next region; nullopt after the last one. Throws Error{kCorrupt} for bytes that are
  // not a record.
  std::optional<EncodedRegion> next();

 private:
  ByteSource in_;
};

}  // namespace voxdag
