// Reads the attributes of selected cells as numbers, for formats that store an attribute as a
// table: one row per cell, with one number per component, such as the three bytes of a color.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/export/export_job.h"

namespace voxdag::query {

// Reads the values of one attribute of the file.
class AttributeCursor {
 public:
  AttributeCursor(const ExportJob& job, Attribute attribute)
      : job_(job),
        traits_(traits_of(attribute)),
        cursor_(job.file, section_of(job.file, attribute)) {}

  const AttributeTraits& traits() const { return traits_; }
  const EncodingTraits& encoding() const { return traits_of(traits_.encoding); }

  // Calls put(number) for each component of the attribute of a cell. `turned_cell` is a set cell of
  // the selected grid, in turned axes (axis_turn.h). A normal is turned likewise. Throws
  // Error{kCorrupt} if the cell has no value.
  template <class Put>
  void put(const std::array<int64_t, 3>& turned_cell, const Put& put) {
    const Position cell = job_.original(turned_cell);
    uint64_t i = 0;
    const voxdag_reader::ColorRegion* const region = with_reader_errors(
        [&] { return cursor_.find(cell[0], cell[1], cell[2], job_.selection.grid_levels, i); });
    if (!region)
      throw Error(ErrorCode::kCorrupt, job_.file.path() + ": " + cell_text(job_, cell) +
                                           " has no " + traits_.name + ": " + damage_text());
    if (traits_.encoding == Encoding::kOctahedral && !job_.turn.is_none())
      put_turned(region->normal(i), put);
    else
      put_value(traits_.attribute, *region, i, put);
  }

 private:
  template <class Put>
  void put_turned(const voxdag_reader::Normal& normal, const Put& put) const {
    const std::array<float, 3> original = {normal.x, normal.y, normal.z};
    for (size_t axis = 0; axis < 3; ++axis) {
      const float component = original[job_.turn.from[axis]];
      put(job_.turn.reversed[axis] ? -component : component);
    }
  }

  const ExportJob& job_;
  const AttributeTraits& traits_;
  voxdag_reader::ColorCursor cursor_;
};

// Returns one cursor for each attribute of the file. Leaves out colors if the job exports none.
inline std::vector<AttributeCursor> exported_attributes(const ExportJob& job) {
  std::vector<AttributeCursor> cursors;
  for (const Attribute attribute : attributes_of(job.file).list())
    if (job.has_colors || attribute != Attribute::kColor) cursors.emplace_back(job, attribute);
  return cursors;
}

// Returns the number of bytes that the values of all these attributes take for one cell.
inline uint64_t decoded_bytes(std::span<const AttributeCursor> attributes) {
  uint64_t bytes = 0;
  for (const AttributeCursor& attribute : attributes) bytes += attribute.encoding().decoded_bytes();
  return bytes;
}

}  // namespace voxdag::query
