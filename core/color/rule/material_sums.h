// The materials of a region's cells. A cell gets the material whose surfaces have the largest sum
// of weights in it. Sums are integers, so the order of the surfaces does not matter.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/color/attributes.h"
#include "core/color/cell_values.h"
#include "core/color/rule/surface_facing.h"

namespace voxdag::color {

// The class for materials in the list of attribute_sums.h.
class MaterialSums {
 public:
  static constexpr Attribute kAttribute = Attribute::kMaterial;

  void add(uint32_t cell, const SurfaceFacing& facing, uint32_t, uint32_t weight) {
    const uint32_t material = facing.material;
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
  void reset(uint32_t cell) {
    if (cell >= materials_.size()) materials_.resize(cell + 1);
    materials_[cell] = {};
    materials_[cell].is_reset = 1;
  }
  void finish() { add_up(); }
  void get(uint32_t cell, CellValues& values) const {
    if (cell < materials_.size()) values.material = heaviest(cell);
  }
  void clear() {
    materials_.clear();
    further_ = {};  // frees the memory, which can be large
    max_further_ = kFewFurther;
  }
  uint64_t bytes() const {
    return materials_.capacity() * sizeof(FirstMaterial) +
           further_.capacity() * sizeof(FurtherMaterial);
  }

 private:
  static constexpr size_t kFewFurther = size_t{1} << 14;

  // Most cells have one material, which is stored by cell. The weights of further materials are in
  // one list for all cells.
  struct FirstMaterial {
    uint32_t material = 0;
    uint32_t is_reset = 0;  // 1 after reset(cell)
    uint64_t weight = 0;    // 0: nothing was added yet
  };
  struct FurtherMaterial {
    uint32_t cell = 0;
    uint32_t material = 0;
    uint64_t weight = 0;  // twice the weight, plus 1 if it was added after reset(cell)

    bool is_like(const FurtherMaterial& other) const {
      return cell == other.cell && material == other.material && !((weight ^ other.weight) & 1);
    }
    bool operator<(const FurtherMaterial& other) const {
      if (cell != other.cell) return cell < other.cell;
      if (material != other.material) return material < other.material;
      return (weight & 1) < (other.weight & 1);
    }
  };

  // Sorts further_ and adds up the weights that belong together: weights for the same cell and
  // material that were all added before reset(cell), or all after it.
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

  std::vector<FirstMaterial> materials_;
  std::vector<FurtherMaterial> further_;
  size_t max_further_ = kFewFurther;  // length of further_ at which add_up() is called next
};

}  // namespace voxdag::color
