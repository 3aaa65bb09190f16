// Offsets and sizes in the color section of the global file. docs/format.md, "The color section",
// describes the section and defines tiers, regions and directories.
//
//   [tier 0] [tier 1] ... [tier table]            tier: [regions' data] [directory]
//
// The voxdag_reader headers include no other headers of voxdag, so they repeat the numbers that
// they need.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/color/blocks/region.h"

namespace voxdag::color_layout {

// The data of a region begin and end at multiples of this size.
inline constexpr size_t kUnitBytes = 16;
static_assert(kBlockBytes == kUnitBytes);

// Offsets in an entry of a tier's directory, which has an entry for each region.
inline constexpr size_t kRegionMortonAt = 0;
inline constexpr size_t kRegionFirstUnitAt = 8;
inline constexpr size_t kRegionCountsAt = 16;  // seven counts: u32, u16, u16, u16, u8, u8, u8
inline constexpr size_t kRegionReservedAt = 29;
inline constexpr size_t kRegionEntryBytes = 32;

// Offsets in an entry of the tier table, which has an entry for each tier.
inline constexpr size_t kTierOffsetAt = 0;  // the data's offset from the start of the section
inline constexpr size_t kTierUnitsAt = 8;   // the data's size in units; then the directory follows
inline constexpr size_t kTierRegionsAt = 16;
inline constexpr size_t kTierCellsAt = 24;  // number of cells of all levels of the tier
inline constexpr size_t kTierEntryBytes = 32;

// Maximum number of materials, and maximum size of their list in bytes.
inline constexpr uint64_t kMaxMaterials = uint64_t{1} << 20;
inline constexpr uint64_t kMaxNamesBytes = uint64_t{64} << 20;

// Number of levels of a tier. Tier t has the levels from finest_level(color_levels, t) to the level
// of its regions, which is coarser by levels_in_region().
inline constexpr uint32_t kTierLevels = kRegionLevels + 1;
inline constexpr uint32_t tier_count(uint32_t color_levels) {
  return color_levels / kTierLevels + 1;
}
inline constexpr uint32_t finest_level(uint32_t color_levels, uint32_t tier) {
  return color_levels - tier * kTierLevels;
}
// Returns how many levels the regions of a tier are above `finest`, the tier's finest level.
inline constexpr uint32_t levels_in_region(uint32_t finest) {
  return finest < kRegionLevels ? finest : kRegionLevels;
}

}  // namespace voxdag::color_layout
