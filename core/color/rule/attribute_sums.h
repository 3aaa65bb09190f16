// The sums of a region's cells for the attributes that do not follow from the ColorSum: normals and
// materials. AttributeSums has a list of classes, one for each such attribute. A cell is given by
// its number in RegionCells, and columns are explained in columns.h.
//
// A class of the list has
//     static constexpr Attribute kAttribute;
//     void add(uint32_t cell, const SurfaceFacing& facing, uint32_t columns, uint32_t weight);
//                                      // adds a triangle that covers `columns` columns of the cell
//     void reset(uint32_t cell);       // drops everything added to the cell so far
//     void finish();                   // called between the last add() and the first get()
//     void get(uint32_t cell, CellValues& values) const;
//     void clear();
//     uint64_t bytes() const;          // allocated bytes
#pragma once

#include <cstdint>
#include <optional>
#include <tuple>

#include "core/color/attribute_set.h"
#include "core/color/rule/material_sums.h"
#include "core/color/rule/normal_sums.h"

namespace voxdag::color {

class AttributeSums {
 public:
  explicit AttributeSums(const AttributeSet& wanted) {
    const auto start = [&]<class Sums>(std::optional<Sums>& sums) {
      if (!wanted.has(Sums::kAttribute)) return;
      sums.emplace();
      is_needed_ = true;
    };
    std::apply([&](auto&... sums) { (start(sums), ...); }, all_);
  }

  bool is_needed() const { return is_needed_; }
  // Adds a triangle to a cell. `columns` and `weight` are 1 if the triangle covers no column of the
  // cell.
  void add(uint32_t cell, const SurfaceFacing& facing, uint32_t columns, uint32_t weight) {
    for_each([&](auto& sums) { sums.add(cell, facing, columns, weight); });
  }
  // Drops the cell's sums. Called once per cell, when a surface first covers a column of the cell.
  void reset(uint32_t cell) {
    for_each([&](auto& sums) { sums.reset(cell); });
  }
  void finish() {
    for_each([](auto& sums) { sums.finish(); });
  }
  void get(uint32_t cell, CellValues& values) const {
    for_each([&](const auto& sums) { sums.get(cell, values); });
  }
  void clear() {
    for_each([](auto& sums) { sums.clear(); });
  }
  // Allocated bytes.
  uint64_t bytes() const {
    uint64_t bytes = 0;
    for_each([&](const auto& sums) { bytes += sums.bytes(); });
    return bytes;
  }

 private:
  void for_each(const auto& use) { visit(all_, use); }
  void for_each(const auto& use) const { visit(all_, use); }
  static void visit(auto& all, const auto& use) {
    const auto use_if_wanted = [&](auto& sums) {
      if (sums) use(*sums);
    };
    std::apply([&](auto&... sums) { (use_if_wanted(sums), ...); }, all);
  }

  std::tuple<std::optional<NormalSums>, std::optional<MaterialSums>> all_;
  bool is_needed_ = false;
};

}  // namespace voxdag::color
