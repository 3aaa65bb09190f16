// What names the colors of a cube: a digest of all that they depend on. Equal keys mean equal
// colors, whichever order the scene has its triangles in, and whatever else it has.
#pragma once

#include <bitset>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/color/rule/color_grid.h"
#include "core/color/surface.h"
#include "core/format/checksum.h"
#include "core/geometry/cube.h"

namespace voxdag {

// Images by their numbers modulo its size: a few more than are meant where there are very many.
using ImageClasses = std::bitset<256>;

// What is known of the surfaces in a bin.
struct BinContent {
  uint64_t surfaces = 0;
  Checksum128 sum;  // over the surfaces, of digests of each with its material's look
  ImageClasses images;
};

// Digests of what each material adds to a color, its name left out. `images`: of the contents of
// each image.
std::vector<Checksum128> look_digests(std::span<const Material> materials,
                                      std::span<const std::string> images);

// Digest of a surface, of its record (surface_record.h) and the look of its material.
Checksum128 surface_digest(std::span<const std::byte> record, const Checksum128& look);

// Of the colors of a cube in which surfaces are `content`.
Checksum128 color_key(const ColorGrid& grid, const Cube& cube, const BinContent& content);

}  // namespace voxdag
