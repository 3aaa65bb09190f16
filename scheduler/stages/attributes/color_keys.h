// Keys for the colors, or another attribute, of a cube: digests of all inputs. Equal keys mean
// equal colors, independent of the order of the scene's triangles and of the rest of the scene.
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

// Set of images, by image number modulo the set's size. With more images than that, a set can
// contain more images than were added.
using ImageClasses = std::bitset<256>;

// Summary of the surfaces in a bin.
struct BinContent {
  uint64_t surfaces = 0;
  Checksum128 sum;  // sum over the surfaces of surface_digest()
  ImageClasses images;
};

// An attribute of the cells, and its size.
struct StoredAttribute {
  Attribute kind = Attribute::kColor;
  uint32_t value_bytes = 0;  // per cell; 0 for colors
};

// Returns a digest of each material's contribution to the attributes, without its name. `images`
// are digests of the image contents.
std::vector<Checksum128> look_digests(std::span<const Material> materials,
                                      std::span<const std::string> images,
                                      const AttributeSet& attributes);

// Returns a digest of a surface's record (surface_record.h) and its material's look.
Checksum128 surface_digest(std::span<const std::byte> record, const Checksum128& look);

// Returns the key of one attribute of a cube whose surfaces have the digest `content`.
Checksum128 attribute_key(const StoredAttribute& attribute, const ColorGrid& grid, const Cube& cube,
                          const BinContent& content);

}  // namespace voxdag
