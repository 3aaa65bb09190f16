// The normals of a region's cells, as sums of area vectors (SurfaceFacing::area). Sums are
// integers, so the order of the triangles does not matter.
#pragma once

#include <cstdint>
#include <vector>

#include "core/color/attributes.h"
#include "core/color/cell_values.h"
#include "core/color/rule/surface_facing.h"

namespace voxdag::color {

// The sum of the triangles' area vectors in a cell. In `turned`, each vector is oriented so that
// its dominant component is positive. If both sides of a thin sheet are in the cell, their vectors
// cancel out in `area`, and `turned` has the sheet's normal.
struct NormalSum {
  int64_t area[3] = {}, turned[3] = {};

  VOXDAG_HD void add(const SurfaceFacing& facing, int64_t columns) {
    for (int a = 0; a < 3; ++a) {
      const int64_t more = columns * facing.area[a];
      area[a] += more;
      turned[a] += facing.is_backward ? -more : more;
    }
  }
};

// Returns the normal of sum.turned if the largest component of sum.area is less than 1/64 of the
// largest component of sum.turned, and otherwise the normal of sum.area. Returns kNoNormal if both
// sums are 0.
VOXDAG_HD inline NormalCode normal_of_sum(const NormalSum& sum) {
  const auto largest = [](const int64_t(&v)[3]) {
    int64_t most = 0;
    for (const int64_t x : v) most = absolute(x) > most ? absolute(x) : most;
    return most;
  };
  const int64_t rest = largest(sum.area), turned = largest(sum.turned);
  const auto& v = 64 * rest < turned ? sum.turned : sum.area;
  return (rest | turned) == 0 ? kNoNormal : encode_normal(v[0], v[1], v[2]);
}

// The class for normals in the list of attribute_sums.h.
class NormalSums {
 public:
  static constexpr Attribute kAttribute = Attribute::kNormal;

  void add(uint32_t cell, const SurfaceFacing& facing, uint32_t columns, uint32_t) {
    if (cell >= sums_.size()) sums_.resize(cell + 1);
    sums_[cell].add(facing, columns);
  }
  void reset(uint32_t cell) {
    if (cell < sums_.size()) sums_[cell] = {};
  }
  void finish() {}
  void get(uint32_t cell, CellValues& values) const {
    if (cell < sums_.size()) values.normal = normal_of_sum(sums_[cell]);
  }
  void clear() { sums_.clear(); }
  uint64_t bytes() const { return sums_.capacity() * sizeof(NormalSum); }

 private:
  std::vector<NormalSum> sums_;
};

}  // namespace voxdag::color
