// A key for one attribute of a cube of the color grid: a digest of all inputs from which the
// attribute's values in the cube are computed. Equal keys mean equal values. A key does not depend
// on the order of the scene's triangles or on parts of the scene outside the cube.
#pragma once

#include <bitset>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/color/attribute_set.h"
#include "core/color/cutouts/cutouts.h"
#include "core/color/rule/color_grid.h"
#include "core/color/surface.h"
#include "core/format/checksum.h"
#include "core/geometry/cube.h"

namespace voxdag {

// A set of images. Bit i % 256 stands for image i. In a scene with more than 256 images, several
// images share a bit, and adding one of them adds all of them.
using ImageClasses = std::bitset<256>;

// Summary of the surfaces in a bin.
struct BinContent {
  uint64_t surfaces = 0;
  Checksum128 sum;  // sum of the surfaces' surface_digest()
  ImageClasses images;
};

// An attribute of the cells, and its size.
struct StoredAttribute {
  Attribute kind = Attribute::kColor;
  uint32_t value_bytes = 0;  // bytes per cell; 0 for colors, which are stored in blocks of 32 cells
};

// Returns the look of each material: a digest of all properties of the material that influence the
// attributes. The material's name is not included. `images` are digests of the image contents.
// `cutouts`: the cutouts that the build leaves out, or null.
std::vector<Checksum128> look_digests(std::span<const Material> materials,
                                      std::span<const std::string> images,
                                      const AttributeSet& attributes,
                                      const Cutouts* cutouts = nullptr);

// Returns a digest of a surface's record (surface_record.h) and its material's look
// (look_digests()).
Checksum128 surface_digest(std::span<const std::byte> record, const Checksum128& look);

// Returns the key of one attribute of a cube whose surfaces have the summary `content`.
Checksum128 attribute_key(const StoredAttribute& attribute, const ColorGrid& grid, const Cube& cube,
                          const BinContent& content);

}  // namespace voxdag
