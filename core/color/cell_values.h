// The values of a cell of the color grid (color_grid.h) that cannot be computed from its ColorSum.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/color/normal_code.h"

namespace voxdag {

struct CellValues {
  NormalCode normal = kNoNormal;
  uint32_t material = 0;  // an index into the list of the scene's materials
};

// Returns the size in bytes of a list of names in the global file, without the padding after it.
inline uint64_t list_bytes(std::span<const std::string> names) {
  uint64_t bytes = sizeof(uint32_t);
  for (const std::string& name : names) bytes += sizeof(uint32_t) + name.size();
  return bytes;
}

}  // namespace voxdag
