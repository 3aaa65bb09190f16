// Reads a library of materials (.mtl). For each material, reads the diffuse color, the opacity and
// the diffuse image.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "core/io/file_system.h"
#include "scene/growing_charge.h"

namespace voxdag::obj {

// A map_... statement: an image file and the mapping of texture coordinates.
struct ImageMap {
  std::string file;  // as in the statement; "": none
  // Texture coordinates (u, v) become scale * (u, v) + offset.
  std::array<double, 2> scale{1, 1}, offset{0, 0};
  bool is_clamped = false;  // true: coordinates are clamped to the edge, not repeated
};

struct LibraryMaterial {
  std::string name;
  std::array<double, 3> diffuse{1, 1, 1};
  bool is_dissolved = false;  // true if a statement d, not Tr, gives `opacity`
  double opacity = 1;
  ImageMap diffuse_map, opacity_map;
};

// Returns the materials of a library, in the order of the file. If a name occurs again, the later
// definition replaces the earlier one, with a warning. Invalid and unsupported statements give
// warnings. Throws Error{kOutOfMemory} and Error{kLimit}.
std::vector<LibraryMaterial> read_library(const ReadableFile& file, MemoryBudget& budget,
                                          GrowingCharge& charge, WarningList& warnings);

// Reads the arguments of a map_... statement. Appends the names of unsupported options that would
// change the lookup to `unsupported`.
ImageMap parse_image_map(std::string_view arguments, std::string& unsupported);

}  // namespace voxdag::obj
