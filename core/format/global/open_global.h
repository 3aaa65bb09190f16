// Opens global files with the standalone reader (voxdag_reader.h), and translates its errors to
// Error.
#pragma once

#include <algorithm>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/color/attribute_set.h"
#include "core/dag/brick.h"
#include "core/format/global/voxdag_reader.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"

namespace voxdag {

inline Error as_error(const voxdag_reader::Error& error) {
  switch (error.problem()) {
    case voxdag_reader::Problem::kNotFound:
      return Error(ErrorCode::kNotFound, error.what());
    case voxdag_reader::Problem::kUnsupportedVersion:
      return Error(ErrorCode::kUnsupportedVersion, error.what());
    case voxdag_reader::Problem::kIo:
      return Error(ErrorCode::kIo, error.what());
    case voxdag_reader::Problem::kCorrupt:
      break;
  }
  return Error(ErrorCode::kCorrupt, error.what());
}

// Returns the result of `use()`. Converts errors of the reader to Error.
template <class Use>
auto with_reader_errors(Use use) {
  try {
    return use();
  } catch (const voxdag_reader::Error& error) {
    throw as_error(error);
  }
}

// Returns the result of `use()`. Adds `path` to an Error{kCorrupt} whose message does not begin
// with it.
template <class Use>
auto naming_file(const std::string& path, const Use& use) {
  try {
    return use();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt || error.message().starts_with(path)) throw;
    throw Error(ErrorCode::kCorrupt, path + ": " + error.message());
  }
}

// The standalone reader repeats the kinds and block sizes of kAttributeTable. They must be equal.
static_assert(std::ranges::all_of(kAttributeTable, [](const AttributeTraits& row) {
  const auto kind = static_cast<uint32_t>(row.attribute);
  return kind < voxdag_reader::kEndOfKinds &&
         voxdag_reader::kKindBlockBytes[kind] == traits_of(row.encoding).block_bytes;
}));

// Returns the section of an attribute. If the file does not have the attribute, the section has no
// tiers.
inline const voxdag_reader::ColorSection& section_of(const voxdag_reader::File& file,
                                                     Attribute attribute) {
  return file.section(static_cast<uint32_t>(attribute));
}

inline Grid grid_of(const voxdag_reader::File& file) {
  const double(&origin)[3] = file.origin();
  return Grid::given({origin[0], origin[1], origin[2]}, file.edge(), file.grid_levels());
}

// Returns the attributes that a file has.
inline AttributeSet attributes_of(const voxdag_reader::File& file) {
  AttributeSet set;
  for (const AttributeTraits& row : kAttributeTable)
    if (section_of(file, row.attribute).tier_count() > 0) set.add(row.attribute);
  return set;
}

// Calls put(number) for each component of the value of cell `i` of a region: three channels of a
// color, three coordinates of a normal, otherwise one number.
template <class Put>
void put_value(Attribute attribute, const voxdag_reader::ColorRegion& region, uint64_t i,
               const Put& put) {
  switch (traits_of(attribute).encoding) {
    case Encoding::kColorBlock: {
      const voxdag_reader::Rgb rgb = region.color(i);
      for (const uint8_t channel : {rgb.r, rgb.g, rgb.b}) put(channel);
      break;
    }
    case Encoding::kByte:
      put(static_cast<uint8_t>(region.value(i)));
      break;
    case Encoding::kOctahedral: {
      const voxdag_reader::Normal normal = region.normal(i);
      for (const float component : {normal.x, normal.y, normal.z}) put(component);
      break;
    }
    case Encoding::kNameIndex:
      put(region.value(i));
      break;
  }
}

// map_global_file() maps the file's bytes, and open_global_bytes() opens a File that reads them. A
// caller that watches the mapping for unreadable pages creates a WatchedMapping between the two
// calls, because opening already reads pages.
inline std::shared_ptr<const voxdag_reader::Bytes> map_global_file(const std::string& path) {
  system_files().open_read(path);  // refuses a folder or a pipe like every other input
  return with_reader_errors([&] {
    return std::make_shared<const voxdag_reader::Bytes>(path, voxdag_reader::Access::kMap);
  });
}
inline std::unique_ptr<voxdag_reader::File> open_global_bytes(
    const std::string& path, std::shared_ptr<const voxdag_reader::Bytes> bytes) {
  return with_reader_errors(
      [&] { return std::make_unique<voxdag_reader::File>(path, std::move(bytes)); });
}

inline std::unique_ptr<voxdag_reader::File> open_global_file(const std::string& path) {
  return open_global_bytes(path, map_global_file(path));
}

// The next two functions descend from cell to cell in the DAG, down to voxels. The *place* of a
// cell is the number with which they find the cell's children. For a node or brick it is the word
// offset in the level. For a cell below a brick it is the mask of the cell's children, which is 0
// for voxels.

// Returns the mask of the existing children of the cell at `place` on level `level`: bit i is set
// if child i exists.
inline uint32_t child_mask_at(const voxdag_reader::File& file, uint32_t level, uint64_t place) {
  if (level < file.brick_level()) return file.node(level, place).child_mask;
  return level == file.brick_level() ? octants(file.brick(place)) : static_cast<uint32_t>(place);
}

// Returns the place of child `index`, which must exist, on level `level` + 1.
inline uint64_t child_place_at(const voxdag_reader::File& file, uint32_t level, uint64_t place,
                               int index) {
  if (level < file.brick_level()) return voxdag_reader::File::child(file.node(level, place), index);
  return level == file.brick_level() ? file.brick(place) >> 8 * index & 255 : 0;
}

}  // namespace voxdag
