// Records of regions, one after another, as stored in the artifacts of the color stage
// (docs/format.md, "Stored colors"). A record has the encoded colors, or the values of another
// attribute, of one region of the color grid.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/color/blocks/region.h"
#include "core/format/bytes.h"

namespace voxdag {

void append_region(const EncodedRegion& region, std::vector<std::byte>& out);

// Reads the records in `bytes`, in the form that append_region() writes. The caller has verified
// the checksum of the bytes.
class RegionRecords {
 public:
  // `path` is the file that contains the records. `path` and `bytes` must outlive the reader.
  RegionRecords(const std::string& path, std::span<const std::byte> bytes)
      : path_(path), in_(bytes) {}
  // Returns the next region; nullopt after the last one. Throws Error{kCorrupt}, which names
  // the file, if the bytes end within a record.
  std::optional<EncodedRegion> next();

 private:
  const std::string& path_;
  ByteSource in_;
  uint64_t count_ = 0;
};

}  // namespace voxdag
