// The libraries of materials that the mtllib statements of an OBJ file name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "core/io/file_system.h"
#include "scene/growing_charge.h"
#include "scene/obj/file/obj_file.h"
#include "scene/obj/materials/mtl_reader.h"
#include "scene/triangle_source.h"

namespace voxdag::obj {

struct LibraryEntry {
  LibraryMaterial material;
  size_t library;  // index into Libraries::files
};

struct Libraries {
  std::vector<SourceFile> files;
  // The materials of all libraries. If several libraries have a material of the same name, only the
  // first library's material is listed.
  std::vector<LibraryEntry> materials;
  std::unordered_map<std::string, uint32_t> numbers;  // index in `materials` by name

  // Returns the index of the material of this name. If no material has it, tries the name without a
  // comment at its end.
  std::optional<uint32_t> find(std::string_view name) const;
};

// Reads all libraries. A library that cannot be opened gives a warning.
Libraries read_libraries(FileSystem& files, const ObjFile& obj, MemoryBudget& budget,
                         GrowingCharge& charge, WarningList& warnings);

}  // namespace voxdag::obj
