// The values of a region for an attribute other than color, as the file stores them: in the order
// of its colors (region.h), with a fixed number of bytes each, the lowest first. They come in
// blocks of 32 cells like colors, the bytes of cells that are not there being 0.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/color/blocks/region.h"
#include "core/color/cell_values.h"

namespace voxdag {

// A cell with a value for one attribute.
struct ValuedCell {
  uint32_t code = 0;   // Morton code within the region
  uint32_t value = 0;  // below 256^bytes
};

// Appends the values that baked cells have, their codes counted from `first_code`. `values` has one
// for each cell, unless the attribute is alpha.
void append_values(Attribute attribute, std::span<const ColoredCell> cells,
                   std::span<const CellValues> values, uint32_t first_code,
                   std::vector<ValuedCell>& out);

// What encode_region() is for colors; `total` stays zero. Coarser cells get value_of_parent().
// Thread-safe. Memory: up to 10 bytes for each cell, aside from what is returned.
EncodedRegion encode_values(Attribute attribute, uint32_t bytes, uint32_t levels, uint64_t morton,
                            std::span<const ValuedCell> cells);

// The value of the `i`-th cell in blocks of values.
inline uint32_t value_at(const std::byte* blocks, uint64_t i, uint32_t bytes) {
  uint32_t value = 0;
  for (uint32_t b = bytes; b-- > 0;)
    value = value << 8 | std::to_integer<uint32_t>(blocks[i * bytes + b]);
  return value;
}
// The value of the coarsest cell, which is the region.
uint32_t value_of_region(const EncodedRegion& region, uint32_t bytes);

}  // namespace voxdag
