// The rules that decide which voxels a scene sets. A rule is a geometry option: it determines the
// bytes of the result. To add a rule, add a value to VoxelRule and a row to kVoxelRules.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace voxdag {

enum class VoxelRule : uint32_t {
  kShell,  // every voxel that a triangle touches (overlap.h)
  kThin,   // every voxel in which a triangle crosses a row through its center (crossing.h)
};

struct VoxelRuleTraits {
  const char* name;  // in reports, requests and state files
  // True if the parallel backends (core/backend/parallel) implement the rule.
  bool is_parallel;
};

// The rows are in the order of the values of VoxelRule.
inline constexpr std::array<VoxelRuleTraits, 2> kVoxelRules = {{
    {"shell", true},
    {"thin", true},
}};

constexpr const VoxelRuleTraits& traits_of(VoxelRule rule) {
  return kVoxelRules[static_cast<size_t>(rule)];
}

constexpr std::array<const char*, kVoxelRules.size()> enum_names(VoxelRule) {
  std::array<const char*, kVoxelRules.size()> names{};
  for (size_t i = 0; i < names.size(); ++i) names[i] = kVoxelRules[i].name;
  return names;
}

}  // namespace voxdag
