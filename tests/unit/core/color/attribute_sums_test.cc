// The material of a cell is the material with the largest weight, for any number and order of
// materials.
#include "core/color/rule/attribute_sums.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <vector>

namespace voxdag {
namespace {

TEST(AttributeSums, FindTheHeaviestOfManyMaterials) {
  constexpr uint32_t kCells = 40, kMaterials = 3000, kAdded = 300000;
  color::AttributeSums sums({Attribute::kMaterial});
  std::mt19937 random(1);
  std::vector<std::map<uint32_t, uint64_t>> weights(kCells);
  std::vector<bool> is_covered(kCells);
  color::SurfaceFacing facing;
  for (int round = 0; round < 2; ++round) {
    for (uint32_t i = 0; i < kAdded; ++i) {
      const auto cell = static_cast<uint32_t>(random() % kCells);
      // At a random time, reset() discards the contributions to a cell with an odd number. The
      // baking code calls reset() when a triangle covers a cell that earlier triangles only
      // touched.
      if (cell % 2 == 1 && !is_covered[cell] && random() % 2000 == 0) {
        sums.reset(cell);
        weights[cell].clear();
        is_covered[cell] = true;
      }
      facing.material = static_cast<uint32_t>(random() % kMaterials);
      const auto weight = static_cast<uint32_t>(1 + random() % 9);
      sums.add(cell, facing, 1, weight);
      weights[cell][facing.material] += weight;
    }
    // There is at most one entry of 16 bytes for each pair of a cell and a material. The factor of
    // 4 is for growing tables.
    EXPECT_LE(sums.bytes(), uint64_t{4} * kCells * kMaterials * 16);
    sums.finish();
    size_t ties = 0;
    for (uint32_t cell = 0; cell < kCells; ++cell) {
      uint32_t best = 0;
      uint64_t most = 0, times = 0;
      for (const auto& [material, weight] : weights[cell]) {
        times = weight > most ? 1 : times + (weight == most);
        if (weight <= most) continue;
        best = material;
        most = weight;
      }
      ties += times > 1;
      CellValues values;
      sums.get(cell, values);
      EXPECT_EQ(values.material, best) << "cell " << cell;
      weights[cell].clear();
      is_covered[cell] = false;
    }
    EXPECT_GT(ties, 0u);
    sums.clear();
  }
}

}  // namespace
}  // namespace voxdag
