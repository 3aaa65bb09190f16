// Converts the argument `fill_color` of the Python functions that combine files.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/format/global/voxdag_reader.h"

namespace voxdag::python {

inline std::optional<voxdag_reader::Rgb> rgb_of(const std::optional<std::array<uint8_t, 3>>& rgb) {
  if (!rgb) return std::nullopt;
  return voxdag_reader::Rgb{rgb->at(0), rgb->at(1), rgb->at(2)};
}

}  // namespace voxdag::python
