// The section of one attribute, such as the color, in a global file. Commands use it to copy values
// of the attribute to a new file. The callers read values from the mapped file. Before that, they
// call the check functions. These verify the checksum blocks of the values, each block once, with
// read calls.
//
// docs/format.md, "The color section", defines tiers and regions.
//
// Thread-safe. All functions throw Error{kCorrupt} and voxdag_reader::Error for a damaged file.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/memory_budget.h"
#include "core/color/attributes.h"
#include "core/color/blocks/region.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "query/attributes/checked_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// Returns the sum of the colors of `n` cells that all have the color `rgb`.
ColorSum sum_of(const voxdag_reader::Rgb& rgb, uint64_t n);

class StoredSection {
 public:
  // `file` must have the attribute, and must outlive this object.
  StoredSection(const voxdag_reader::File& file, Attribute attribute, FileSystem& files,
                MemoryBudget& budget);

  const voxdag_reader::File& file() const { return file_; }
  const voxdag_reader::ColorSection& section() const { return section_; }

  // Verifies the data with which values are found: the levels 0 to `finest` of the DAG, the
  // directories of the regions and the list of names. Throws Error{kCanceled}.
  void check_index(uint32_t finest, const CancelToken& cancel);
  // Verifies the values of a cube, which is at `code` on `level`, and of all its cells down to the
  // level `finest`.
  void check_values(uint32_t finest, uint32_t level, uint64_t code);

  // Returns a copy of the region at `code` of a tier, for a color section. The copy has the Morton
  // code `morton`. check_values() must have verified the region.
  EncodedRegion copy_region(const voxdag_reader::ColorTier& tier, uint64_t code,
                            uint64_t morton) const;
  // Returns value i of a region, for an attribute other than color. The value belongs to the cell
  // at `code` on `level`. Error messages name this cell.
  uint32_t value(const voxdag_reader::ColorRegion& region, uint64_t i, uint32_t level,
                 uint64_t code) const;
  // Throws an error for a cell without a valid value; `what` is the predicate of the message.
  [[noreturn]] void broken_cell(uint32_t level, uint64_t code, const std::string& what) const;

 private:
  uint64_t offset_of(const unsigned char* at) const {
    return static_cast<uint64_t>(at - file_.data());
  }

  const voxdag_reader::File& file_;
  const AttributeTraits& traits_;
  const voxdag_reader::ColorSection& section_;
  CheckedReader source_;
};

}  // namespace voxdag::query
