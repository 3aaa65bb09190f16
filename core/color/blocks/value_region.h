// Encodes the values of a region for an attribute other than color, as the file stores them. Values
// are in the same order as colors (region.h). Each value has a fixed number of bytes, lowest byte
// first. Like colors, values are stored in blocks of 32 cells. Bytes of missing cells are 0.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/color/attributes.h"
#include "core/color/blocks/region.h"

namespace voxdag {

// A cell with a value for one attribute.
struct ValuedCell {
  uint32_t code = 0;   // Morton code within the region
  uint32_t value = 0;  // below 256^bytes (see encode_values())
};

// Encodes a region, as encode_region() does for colors, and leaves `total` zero. `bytes` is the
// number of bytes per value, see value_bytes(). The values of coarser cells are computed by the
// attribute's value_of_parent(). Thread-safe. Memory: up to 10 bytes for each cell, in addition to
// the result.
EncodedRegion encode_values(Attribute attribute, uint32_t bytes, uint32_t levels, uint64_t morton,
                            std::span<const ValuedCell> cells);

// Returns the value of the `i`-th cell in blocks of values of `bytes` bytes each.
inline uint32_t value_at(const std::byte* blocks, uint64_t i, uint32_t bytes) {
  uint32_t value = 0;
  for (uint32_t b = bytes; b-- > 0;)
    value = value << 8 | std::to_integer<uint32_t>(blocks[i * bytes + b]);
  return value;
}
// Returns the value of the coarsest cell, which is the region.
uint32_t value_of_region(const EncodedRegion& region, uint32_t bytes);

}  // namespace voxdag
