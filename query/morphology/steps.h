// Divides a dilation or an erosion by a cube of voxels into steps that NeighborLevels can do.
//
// A dilation by N sets a voxel p if a voxel q with |p - q| <= N on each axis is set. An erosion by
// N keeps a voxel p if all voxels q with |p - q| <= N are set. Both first consider only the voxels
// q <= p, and then, for the result, only the voxels q >= p. Each of these two halves has steps that
// increase the reach b, which is 0 at first, to N:
//
//   - a *window* of d <= 4 voxels considers the voxels p - t for all t in {0, ..., d}^3, and
//     increases the reach by d;
//   - a *jump* of d >= 4 voxels, a power of two, considers the voxels p - t for all t in {0, d}^3.
//     It increases the reach by d if d <= b + 1.
//
// So the number of steps grows with the logarithm of N. A step needs no results outside of the
// grid: if q <= p are voxels of the grid, then all voxels between q and p are in the grid.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

namespace voxdag::query {

struct MorphologyStep {
  bool is_erosion = false;
  bool is_outside_set = false;  // voxels outside of the grid count as set; only for erosions
  bool is_window = false;
  bool is_upward = false;  // true: considers the voxels p + t instead of p - t
  uint64_t distance = 0;   // d
};

// The largest window: a brick's edge, so that a brick depends only on adjacent bricks.
inline constexpr uint64_t kMaxWindow = 4;

inline std::vector<MorphologyStep> morphology_steps(bool is_erosion, bool is_outside_set,
                                                    uint64_t voxels) {
  std::vector<MorphologyStep> steps;
  for (const bool is_upward : {false, true}) {
    uint64_t reach = 0;
    const auto add = [&](bool is_window, uint64_t distance) {
      steps.push_back({is_erosion, is_outside_set, is_window, is_upward, distance});
      reach += distance;
    };
    add(true, std::min(voxels, kMaxWindow));
    // The rest becomes a multiple of 4, so jumps can reach it.
    if ((voxels - reach) % kMaxWindow != 0) add(true, (voxels - reach) % kMaxWindow);
    while (reach < voxels) add(false, std::bit_floor(std::min(reach + 1, voxels - reach)));
  }
  return steps;
}

}  // namespace voxdag::query
