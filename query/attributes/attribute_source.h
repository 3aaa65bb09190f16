// A file from which a combined file (combined_section.h) takes the values of an attribute. Its grid
// can have another size and another place than the grid of the result.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "core/base/memory_budget.h"
#include "core/format/global/open_global.h"
#include "core/geometry/morton.h"
#include "core/io/file_system.h"
#include "query/attributes/combined_section.h"
#include "query/attributes/stored_section.h"
#include "query/dag/dag_view.h"
#include "voxdag/cells.h"

namespace voxdag::query {

// Returns the position of a cube with this Morton code.
inline Position position_of(uint64_t code) {
  uint32_t x, y, z;
  morton_decode(code, x, y, z);
  return {x, y, z};
}

// A file from which the result takes values. Levels and codes are levels and Morton codes of the
// result's grid, except where a name begins with `file_`: these are of the file's grid.
class AttributeSource {
 public:
  AttributeSource(const voxdag_reader::File& file, Attribute attribute, uint32_t grid_levels,
                  const Position& offset, FileSystem& files, MemoryBudget& budget)
      : stored_(file, attribute, files, budget),
        attribute_(attribute),
        dag_(file),
        grid_levels_(grid_levels),
        offset_(offset) {}

  StoredSection& stored() { return stored_; }
  const StoredSection& stored() const { return stored_; }
  const voxdag_reader::ColorSection& section() const { return stored_.section(); }
  const DagView& dag() const { return dag_; }

  // Returns the level of the file whose cubes have the edge of the cubes of `level`. It is negative
  // if these cubes are larger than the file's grid.
  int64_t file_level(uint32_t level) const {
    return static_cast<int64_t>(stored_.file().grid_levels()) - grid_levels_ + level;
  }
  // Returns finest_level_of() the file.
  int64_t finest() const { return finest_level_of(stored_.file(), attribute_, grid_levels_); }
  // True if each cube of `level` has the position of a cube of the file with the same edge, or is
  // outside the file's grid.
  bool is_aligned(uint32_t level) const {
    const auto is_multiple = [&](int64_t distance) { return (distance & (edge(level) - 1)) == 0; };
    return std::ranges::all_of(offset_, is_multiple);
  }

  // Calls visit(file_position, overlap) for the positions of the file's cubes of file_level(level)
  // that overlap the cube at `code`, in the order of x, y and z. A position may be outside the
  // file's grid. `overlap` is the common volume in voxels.
  template <class Visit>
  void for_each_overlap(uint32_t level, uint64_t code, const Visit& visit) const {
    const Position at = position_of(code);
    const int64_t size = edge(level);
    Position first, rest;
    for (size_t axis = 0; axis < 3; ++axis) {
      const int64_t low = at[axis] * size - offset_[axis];
      rest[axis] = low & (size - 1);
      first[axis] = (low - rest[axis]) / size;
    }
    for (size_t i = 0; i < 8; ++i) {
      Position position = first;
      uint64_t overlap = 1;
      for (size_t axis = 0; axis < 3; ++axis) {
        const bool is_upper = i >> (2 - axis) & 1;
        position[axis] += is_upper;
        overlap *= static_cast<uint64_t>(is_upper ? rest[axis] : size - rest[axis]);
      }
      if (overlap > 0) visit(position, overlap);
    }
  }

  // Returns the Morton code of the file's cube at the place of the cube at `code`; nothing if the
  // place is outside the file's grid. is_aligned(level) must be true.
  std::optional<uint64_t> file_code(uint32_t level, uint64_t code) const {
    std::optional<uint64_t> found;
    for_each_overlap(level, code, [&](const Position& at, uint64_t) {
      if (is_inside(level, at)) found = morton(at);
    });
    return found;
  }

  // Finds the value of a cell (combined_section.h): returns the region that has it, valid until
  // the next call, and sets `i` to its index in the region. Returns null if no cube of the file
  // that overlaps the cell has voxels. These voxels can be outside the cell if
  // !is_aligned(level).
  const voxdag_reader::ColorRegion* find(voxdag_reader::ColorCursor& cursor, uint32_t level,
                                         uint64_t code, uint64_t& i) const {
    struct Candidate {
      Position at;
      uint64_t overlap;
    };
    std::array<Candidate, 8> candidates;
    size_t count = 0;
    for_each_overlap(level, code, [&](const Position& at, uint64_t overlap) {
      candidates[count++] = {at, overlap};
    });
    const auto used = std::span(candidates).first(count);
    if (count > 1) std::ranges::stable_sort(used, std::greater(), &Candidate::overlap);
    for (const auto& [at, overlap] : used)
      if (const voxdag_reader::ColorRegion* const region =
              cursor.find(at[0], at[1], at[2], static_cast<uint32_t>(file_level(level)), i))
        return region;
    return nullptr;
  }

  // Verifies the file's values in the cube at `code`, down to the level `finest`.
  void check_values(uint32_t finest, uint32_t level, uint64_t code) {
    const auto file_finest = static_cast<uint32_t>(file_level(finest));
    if (file_level(level) < 0) return stored_.check_values(file_finest, 0, 0);
    for_each_overlap(level, code, [&](const Position& at, uint64_t) {
      if (is_inside(level, at))
        stored_.check_values(file_finest, static_cast<uint32_t>(file_level(level)), morton(at));
    });
  }

 private:
  int64_t edge(uint32_t level) const { return int64_t{1} << (grid_levels_ - level); }
  bool is_inside(uint32_t level, const Position& at) const {
    const int64_t levels = file_level(level);
    return levels >= 0 &&
           std::ranges::all_of(at, [&](int64_t i) { return i >= 0 && i < int64_t{1} << levels; });
  }
  static uint64_t morton(const Position& at) {
    return morton_encode(static_cast<uint32_t>(at[0]), static_cast<uint32_t>(at[1]),
                         static_cast<uint32_t>(at[2]));
  }

  StoredSection stored_;
  const Attribute attribute_;
  const DagView dag_;
  const uint32_t grid_levels_;  // levels of the result's grid
  const Position offset_;
};

}  // namespace voxdag::query
