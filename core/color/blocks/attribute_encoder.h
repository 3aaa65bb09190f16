// Encodes the cells of a region for one attribute: colors from the sums of the cells (region.h),
// other attributes from their values (value_region.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/color/blocks/region.h"
#include "core/color/blocks/value_region.h"
#include "core/color/cell_values.h"

namespace voxdag {

class AttributeEncoder {
 public:
  // `value_bytes` is the result of value_bytes(); it is not used for colors. `levels` has the same
  // meaning as in the constructor of RegionEncoder (region.h).
  AttributeEncoder(Attribute attribute, uint32_t value_bytes, uint32_t levels)
      : traits_(traits_of(attribute)),
        value_bytes_(value_bytes),
        levels_(levels),
        colors_(levels) {}

  // Adds baked cells in increasing order of their codes. The code of a cell in the region is
  // `first_code` + cell.code. For attributes that AttributeSums computes (normals and materials),
  // `values` must have an element for each cell. Otherwise `values` may be empty.
  void add(std::span<const ColoredCell> cells, std::span<const CellValues> values,
           uint32_t first_code);
  // Returns the encoder of colors, to which cells can be added directly; null for other attributes.
  RegionEncoder* colors() { return traits_.is_color() ? &colors_ : nullptr; }
  bool empty() const { return traits_.is_color() ? colors_.empty() : values_.empty(); }
  // Returns the encoded region; `morton` is its EncodedRegion::morton. Call it once, after at least
  // one cell was added.
  EncodedRegion finish(uint64_t morton);

 private:
  const AttributeTraits& traits_;
  uint32_t value_bytes_, levels_;
  RegionEncoder colors_;
  std::vector<ValuedCell> values_;
};

}  // namespace voxdag
