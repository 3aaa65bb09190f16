#include "core/color/blocks/attribute_encoder.h"

namespace voxdag {

void AttributeEncoder::add(std::span<const ColoredCell> cells, std::span<const CellValues> values,
                           uint32_t first_code) {
  if (traits_.is_color()) return colors_.add(cells, first_code);
  const CellValues none;
  values_.reserve(values_.size() + cells.size());
  for (size_t i = 0; i < cells.size(); ++i)
    values_.push_back({first_code + cells[i].code,
                       traits_.value_of_cell(cells[i].sum, values.empty() ? none : values[i])});
}

EncodedRegion AttributeEncoder::finish(uint64_t morton) {
  return traits_.is_color()
             ? colors_.finish(morton)
             : encode_values(traits_.attribute, value_bytes_, levels_, morton, values_);
}

}  // namespace voxdag
