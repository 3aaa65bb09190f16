// The values of cells aside from their colors: alpha, a normal and a material, each a number. The
// value of a coarser cell is a function of those of its set children, which are stored: so it can
// be derived again from a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "core/color/attribute_set.h"
#include "core/color/normal_code.h"

namespace voxdag {

// Of a cell of the color grid, besides alpha, which the sum of its color has.
struct CellValues {
  NormalCode normal = kNoNormal;
  uint32_t material = 0;  // a number in the list of the scene's materials
};

// Of kNormal or kMaterial.
inline uint32_t value_of(const CellValues& values, Attribute attribute) {
  return attribute == Attribute::kNormal ? values.normal : values.material;
}

// Bytes that a value takes in a file; `materials` is the length of the list.
inline constexpr uint32_t value_bytes(Attribute attribute, uint64_t materials) {
  if (attribute == Attribute::kAlpha) return 1;
  if (attribute == Attribute::kNormal) return 2;
  return materials <= 256 ? 1 : materials <= 65536 ? 2 : 4;
}

// Bytes that the list of their names takes there, without the zeros that follow.
inline uint64_t list_bytes(std::span<const std::string> materials) {
  uint64_t bytes = sizeof(uint32_t);
  for (const std::string& name : materials) bytes += sizeof(uint32_t) + name.size();
  return bytes;
}

// The value of a cell from those of its 1 to 8 set children, in Morton order. `attribute` is not
// color. Alpha: the mean, rounded to nearest (half up). Normal: the children's if they have the
// same one, otherwise that of the sum of their directions, the first child's where the sum is zero.
// Material: the most frequent one, the
// lowest of several.
uint32_t value_of_parent(Attribute attribute, std::span<const uint32_t> children);

}  // namespace voxdag
