// Keys of the colors of a cube, or another attribute: digests of all inputs. Equal
// keys mean equal colors, whichever order the scene has its triangles in, and whatever else it has.
#pragma once

#include <bitset>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/color/attribute_set.h"
#include "core/color/rule/color_grid.h"
#include "core/color/surface.h"
#include "core/format/checksum.h"
#include "core/geometry/cube.h"

namespace voxdag {

// Images by their numbers modulo its size: a few more than are meant where there are very many.
using ImageClasses = std::bitset<256>;

// Summary of the surfaces in a bin.
struct BinContent {
  uint64_t surfaces = 0;
  Checksum128 sum;  // over the surfaces, of digests of each with its material's look
  ImageClasses images;
};

// An attribute of the cells, and how it is stored.
struct StoredAttribute {
  Attribute kind = Attribute::kColor;
  uint32_t value_bytes = 0;  // of a cell; 0 for colors
};

// Returns a digest of each material's contribution to the attributes, without its name. `images`
// are digests of the image contents.
std::vector<Checksum128> look_digests(std::span<const Material> materials,
                                      std::span<const std::string> images,
                                      const AttributeSet& attributes);

// Digest of a surface, of its record (surface_record.h) and the look of its material.
Checksum128 surface_digest(std::span<const std::byte> record, const Checksum128& look);

// Key of one attribute of a cube whose surfaces have the digest `content`.
Checksum128 attribute_key(const StoredAttribute& attribute, const ColorGrid& grid, const Cube& cube,
                          const BinContent& content);

}  // namespace voxdag
