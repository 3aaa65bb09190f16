// Two tables: kAttributeTable has a row for each attribute of voxels, and kEncodingTable has a row
// for each encoding of attribute values. Code that treats all attributes alike loops over the
// tables. A new attribute with one of these encodings needs only a row here, and code in the few
// places that docs/architecture.md, "Adding things", lists.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <span>

namespace voxdag {

struct CellValues;
struct ColorSum;

// The value of an enumerator is the kind of the attribute's section in the global file.
enum class Attribute : uint32_t { kColor = 1, kAlpha = 2, kNormal = 3, kMaterial = 4 };

// How the global file stores the value of a cell.
enum class Encoding : uint8_t {
  kColorBlock,  // the colors of 32 cells in 16 bytes (block_codec.h)
  kByte,        // one byte, 0 to 255
  kOctahedral,  // a unit vector in two bytes, each 0 to 254 (normal_code.h)
  kNameIndex,   // an index into a list of names, which is stored after the values
};

// Number types of values in queries and exports.
enum class NumberType : uint8_t { kUint8, kUint32, kFloat };

struct EncodingTraits {
  Encoding encoding;
  uint32_t block_bytes;  // size of a block of 32 cells; 0 if it depends on the number of names
  NumberType number;
  uint32_t components;  // number of components of a value

  constexpr uint32_t decoded_bytes() const {
    return components * (number == NumberType::kUint8 ? 1 : 4);
  }
};

inline constexpr EncodingTraits kEncodingTable[] = {
    {Encoding::kColorBlock, 16, NumberType::kUint8, 3},
    {Encoding::kByte, 32, NumberType::kUint8, 1},
    {Encoding::kOctahedral, 64, NumberType::kFloat, 3},
    {Encoding::kNameIndex, 0, NumberType::kUint32, 1},
};

constexpr const EncodingTraits& traits_of(Encoding encoding) {
  return kEncodingTable[static_cast<size_t>(encoding)];
}

namespace attribute_rules {

uint32_t alpha_of_cell(const ColorSum& sum, const CellValues& values);
uint32_t normal_of_cell(const ColorSum& sum, const CellValues& values);
uint32_t material_of_cell(const ColorSum& sum, const CellValues& values);

// The next three functions compute the value of a cell from the values of its 1 to 8 set children,
// which are in Morton order.
//
// Returns the mean, rounded to nearest (half up).
uint32_t mean_alpha(std::span<const uint32_t> children);
// Returns the children's normal if all are equal. Otherwise returns the normal of the sum of their
// directions, or the first child's normal if this sum is zero.
uint32_t mean_normal(std::span<const uint32_t> children);
// Returns the most frequent value; on ties, the lowest.
uint32_t commonest(std::span<const uint32_t> children);

}  // namespace attribute_rules

struct AttributeTraits {
  Attribute attribute;
  const char* name;    // name in options, JSON and messages
  const char* plural;  // plural of the name, in arrays, sections and messages
  Encoding encoding;
  bool uses_images = false;       // the attribute depends on the scene's textures
  const char* ply_properties[3];  // names of a value's components
  // value_of_cell() returns the value of a cell of the finest level, from the sums of its surfaces.
  // value_of_parent() returns the value of a coarser cell from its set children. Both are null for
  // colors, which are encoded from the cells' sums.
  uint32_t (*value_of_cell)(const ColorSum& sum, const CellValues& values) = nullptr;
  uint32_t (*value_of_parent)(std::span<const uint32_t> children) = nullptr;

  constexpr bool is_color() const { return encoding == Encoding::kColorBlock; }
  constexpr bool has_names() const { return encoding == Encoding::kNameIndex; }
};

// Rows are in the order of their sections in the global file.
inline constexpr AttributeTraits kAttributeTable[] = {
    {.attribute = Attribute::kColor,
     .name = "color",
     .plural = "colors",
     .encoding = Encoding::kColorBlock,
     .uses_images = true,
     .ply_properties = {"red", "green", "blue"}},
    {.attribute = Attribute::kAlpha,
     .name = "alpha",
     .plural = "alphas",
     .encoding = Encoding::kByte,
     .uses_images = true,
     .ply_properties = {"alpha"},
     .value_of_cell = attribute_rules::alpha_of_cell,
     .value_of_parent = attribute_rules::mean_alpha},
    {.attribute = Attribute::kNormal,
     .name = "normal",
     .plural = "normals",
     .encoding = Encoding::kOctahedral,
     .ply_properties = {"nx", "ny", "nz"},
     .value_of_cell = attribute_rules::normal_of_cell,
     .value_of_parent = attribute_rules::mean_normal},
    {.attribute = Attribute::kMaterial,
     .name = "material",
     .plural = "materials",
     .encoding = Encoding::kNameIndex,
     .ply_properties = {"material"},
     .value_of_cell = attribute_rules::material_of_cell,
     .value_of_parent = attribute_rules::commonest},
};

constexpr const AttributeTraits& traits_of(Attribute attribute) {
  return kAttributeTable[static_cast<size_t>(attribute) - 1];
}

// Each row must be at the position of its enumerator, because traits_of() uses the enumerators as
// indexes.
static_assert([] {
  for (size_t i = 0; i < std::size(kEncodingTable); ++i)
    if (kEncodingTable[i].encoding != static_cast<Encoding>(i)) return false;
  for (size_t i = 0; i < std::size(kAttributeTable); ++i)
    if (kAttributeTable[i].attribute != static_cast<Attribute>(i + 1)) return false;
  return true;
}());

constexpr const char* name_of(Attribute attribute) { return traits_of(attribute).name; }

// Returns the bytes per value in the global file, for attributes other than color. `names` is the
// length of the list of names, which only attributes of the encoding kNameIndex have.
constexpr uint32_t value_bytes(Attribute attribute, uint64_t names) {
  const uint32_t block_bytes = traits_of(traits_of(attribute).encoding).block_bytes;
  if (block_bytes > 0) return block_bytes / 32;
  return names <= 256 ? 1 : names <= 65536 ? 2 : 4;
}

// Returns null if a stored value is valid. Otherwise returns the problem and the expectation, for
// an error message. `names` is the length of the list of names.
constexpr const char* value_error(Encoding encoding, uint32_t value, uint64_t names) {
  if (encoding == Encoding::kOctahedral && ((value & 255) == 255 || value >> 8 == 255))
    return "a byte of the normal is 255, expected at most 254";
  if (encoding == Encoding::kNameIndex && value >= names)
    return "it is not an index of the list of names, expected one";
  return nullptr;
}

}  // namespace voxdag
