// The header of a PLY file: its elements, and how the properties of each are stored.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"

namespace voxdag::ply {

enum class Format { kAscii, kLittleEndian, kBigEndian };
enum class Type : uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat,
  kDouble
};

constexpr size_t bytes_of(Type type) {
  constexpr size_t kBytes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return kBytes[static_cast<size_t>(type)];
}
constexpr bool is_integer(Type type) { return type < Type::kFloat; }

struct Property {
  std::string name;
  Type type = Type::kFloat;  // for a list: type of its entries
  bool is_list = false;
  Type count_type = Type::kUint8;  // for a list: the integer type of its count
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;

  // Returns the index of the property with this name. If there is none, ignores upper and lower
  // case and returns the first match. Returns the number of properties if no name matches.
  size_t find(std::string_view property) const;
};

struct Header {
  Format format = Format::kAscii;
  std::vector<Element> elements;
  std::vector<std::string> texture_files;  // names from the comments "TextureFile NAME"
  uint64_t ignored_lines = 0;              // lines that are not part of PLY
  uint64_t first_ignored_line = 0;         // line number of the first ignored line
  std::string first_ignored_word;
  uint64_t data_begin = 0;  // offset of the first element

  // Returns the index of an element, as Element::find() does.
  size_t find(std::string_view element) const;
};

// Returns the position of the line end of the line "ply", with which a PLY file begins. Blanks and
// line ends may precede this line. Returns 0 if the text does not begin with this line.
size_t first_line_bytes(std::string_view text);

// Reads the header of an open file. Throws Error{kInvalidInput} with the number of an invalid line,
// Error{kLimit} for a header of over 64 KiB.
Header read_header(const ReadableFile& file, MemoryBudget& budget);

}  // namespace voxdag::ply
