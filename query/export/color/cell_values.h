// What selected cells have besides colors (alpha, normals, materials), for formats of tables: a
// few numbers for each attribute of the file.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/export/export_job.h"

namespace voxdag::query {

// The attributes of the file without color.
inline std::vector<Attribute> exported_values(const ExportJob& job) {
  AttributeSet set = attributes_of(job.file);
  set.color = false;
  return set.list();
}

// Bytes of a cell: a byte of alpha, three floats, or the number of a material in 32 bits.
inline constexpr uint64_t exported_bytes(Attribute attribute) {
  return attribute == Attribute::kAlpha ? 1 : attribute == Attribute::kNormal ? 12 : 4;
}

class CellValueCursor {
 public:
  CellValueCursor(const ExportJob& job, Attribute attribute)
      : job_(job), attribute_(attribute), cursor_(job.file, section_of(job.file, attribute)) {}

  // Calls put(number), with a uint8_t, three floats or a uint32_t. Throws Error{kCorrupt}.
  template <class Put>
  void put(const std::array<int64_t, 3>& cell, const Put& put) {
    uint64_t i = 0;
    const voxdag_reader::ColorRegion* const region = with_reader_errors(
        [&] { return cursor_.find(cell[0], cell[1], cell[2], job_.selection.grid_levels, i); });
    if (!region)
      throw Error(ErrorCode::kCorrupt, job_.file.path() + ": a cell has no " + name_of(attribute_) +
                                           ": the file is damaged (voxdag verify says where)");
    if (attribute_ == Attribute::kAlpha) return put(static_cast<uint8_t>(region->value(i)));
    if (attribute_ == Attribute::kMaterial) return put(region->value(i));
    const voxdag_reader::Normal normal = region->normal(i);
    for (const float component : {normal.x, normal.y, normal.z}) put(component);
  }

 private:
  const ExportJob& job_;
  const Attribute attribute_;
  voxdag_reader::ColorCursor cursor_;
};

}  // namespace voxdag::query
