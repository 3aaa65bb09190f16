// What the surfaces in the cells of a region add up to besides their colors: areas along the axes,
// for normals, and weights by material. docs/color.md, "Other attributes", has the rule in words.
// All sums are integers and commute.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/host_device.h"
#include "core/color/cell_values.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/surface.h"

namespace voxdag::color {

// Of a column that a triangle covers: its area, square to the dominant axis, is 1 of these.
inline constexpr double kColumnArea = 1 << 20;

// What a triangle adds to the cells that it touches.
struct SurfaceFacing {
  // For each column: the normal, as long as the column's area. Up to kColumnArea along each axis.
  int64_t area[3] = {};
  bool is_backward = false;  // its dominant component is negative
  uint32_t material = 0;
};

template <class Int>
VOXDAG_HD inline void set_area(const FixedTriangle& triangle, SurfaceFacing& facing) {
  Int n[3];
  normal_of(triangle, n);
  int dominant = magnitude(n[1]) > magnitude(n[0]) ? 1 : 0;
  if (magnitude(n[2]) > magnitude(n[dominant])) dominant = 2;
  if (n[dominant] == 0) return;
  const double scale = kColumnArea / to_double(magnitude(n[dominant]));
  for (int a = 0; a < 3; ++a) {
    const double length = to_double(magnitude(n[a])) * scale;
    const auto rounded = static_cast<int64_t>(length + 0.5);
    facing.area[a] = n[a] < 0 ? -rounded : rounded;
  }
  facing.is_backward = n[dominant] < 0;
}

// `material` is the number of its material in the list.
VOXDAG_HD inline SurfaceFacing facing_of(const FixedSurface& surface, uint32_t material) {
  SurfaceFacing facing;
  facing.material = material;
  if (is_narrow(surface.position))
    set_area<int64_t>(surface.position, facing);
  else
    set_area<int128>(surface.position, facing);
  if (!surface.is_flipped) return facing;
  for (int64_t& area : facing.area) area = -area;
  facing.is_backward = !facing.is_backward;
  return facing;
}

// The sum of the areas in a cell, and of the same with the dominant component turned positive: the
// orientation of a sheet whose two sides are in the cell.
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

// Of the sum of all areas, unless less than 1/64 of the turned ones is left of them.
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

// For the cells of a region, by the numbers that RegionCells gives them. Alpha needs no sums.
class AttributeSums {
 public:
  explicit AttributeSums(const AttributeSet& set)
      : has_normals_(set.normal), has_materials_(set.material) {}

  bool is_needed() const { return has_normals_ || has_materials_; }
  // `columns` is 1 for a triangle that covers none, as is then `weight`.
  void add(uint32_t cell, const SurfaceFacing& facing, uint32_t columns, uint32_t weight) {
    if (has_normals_) {
      if (cell >= normals_.size()) normals_.resize(cell + 1);
      normals_[cell].add(facing, columns);
    }
    if (has_materials_) add_material(cell, facing.material, weight);
  }
  // The cell is covered from now on: what was added so far does not count. Once for each cell.
  void reset(uint32_t cell) {
    if (cell < normals_.size()) normals_[cell] = {};
    if (!has_materials_) return;
    if (cell >= materials_.size()) materials_.resize(cell + 1);
    materials_[cell] = {};
    materials_[cell].is_reset = 1;
  }
  // Before get(), when all is added.
  void finish() { add_up(); }
  // Sets the values of a cell that are asked for.
  void get(uint32_t cell, CellValues& values) const {
    if (cell < normals_.size()) values.normal = normal_of_sum(normals_[cell]);
    if (cell < materials_.size()) values.material = heaviest(cell);
  }
  void clear() {
    normals_.clear();
    materials_.clear();
    further_ = {};  // which may be large
    max_further_ = kFewFurther;
  }
  // What is allocated.
  uint64_t bytes() const {
    return normals_.capacity() * sizeof(NormalSum) + materials_.capacity() * sizeof(FirstMaterial) +
           further_.capacity() * sizeof(FurtherMaterial);
  }

 private:
  static constexpr size_t kFewFurther = size_t{1} << 14;

  // Cells mostly have one material; the weights of others are in a list of all cells.
  struct FirstMaterial {
    uint32_t material = 0;
    uint32_t is_reset = 0;
    uint64_t weight = 0;  // 0: nothing was added yet
  };
  struct FurtherMaterial {
    uint32_t cell = 0;
    uint32_t material = 0;
    uint64_t weight = 0;  // twice the weight, and whether it came after the reset

    bool is_like(const FurtherMaterial& other) const {
      return cell == other.cell && material == other.material && !((weight ^ other.weight) & 1);
    }
    bool operator<(const FurtherMaterial& other) const {
      if (cell != other.cell) return cell < other.cell;
      if (material != other.material) return material < other.material;
      return (weight & 1) < (other.weight & 1);
    }
  };

  void add_material(uint32_t cell, uint32_t material, uint32_t weight) {
    if (cell >= materials_.size()) materials_.resize(cell + 1);
    FirstMaterial& first = materials_[cell];
    if (first.weight == 0) first.material = material;
    if (first.material == material) {
      first.weight += weight;
      return;
    }
    further_.push_back({cell, material, uint64_t{weight} << 1 | first.is_reset});
    if (further_.size() < max_further_) return;
    add_up();
    max_further_ = std::max(2 * further_.size(), kFewFurther);
  }
  // The weights of a cell's material become one.
  void add_up() {
    std::sort(further_.begin(), further_.end());
    size_t count = 0;
    for (const FurtherMaterial& more : further_) {
      if (count > 0 && further_[count - 1].is_like(more))
        further_[count - 1].weight += more.weight & ~uint64_t{1};
      else
        further_[count++] = more;
    }
    further_.resize(count);
  }
  uint32_t heaviest(uint32_t cell) const {
    const FirstMaterial& first = materials_[cell];
    uint32_t best = first.material;
    uint64_t most = first.weight;
    auto more = std::lower_bound(further_.begin(), further_.end(), FurtherMaterial{cell, 0, 0});
    for (; more != further_.end() && more->cell == cell; ++more) {
      const uint64_t weight = more->weight >> 1;
      if ((more->weight & 1) != first.is_reset || weight < most) continue;
      if (weight > most || more->material < best) best = more->material;
      most = weight;
    }
    return best;
  }

  const bool has_normals_, has_materials_;
  std::vector<NormalSum> normals_;
  std::vector<FirstMaterial> materials_;
  std::vector<FurtherMaterial> further_;
  size_t max_further_ = kFewFurther;  // before their weights are added up
};

}  // namespace voxdag::color
