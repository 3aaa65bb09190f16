// Triangle scenes from a seed, placed in and around a region of the grid. Each kind of scene is an
// arrangement of triangles that has revealed a defect. The same seed gives the same triangles on
// every machine.
#pragma once

#include <random>
#include <string>

#include "tests/oracle/triangle.h"

namespace oracle {

enum class SceneKind {
  kSoup,            // random triangles of mixed sizes
  kDegenerate,      // points, segments, doubled vertices, collinear vertices
  kSliver,          // long and a few units thin
  kSubVoxel,        // triangles smaller than a voxel, within one voxel or across several
  kWalls,           // axis-aligned rectangles
  kDiagonal,        // planes of 45 degrees that pass exactly through voxel edges
  kSpanning,        // from one side of the region to another
  kCoincident,      // the same triangles again, with rotated vertices
  kThroughCorners,  // edges exactly through voxel corners
  kCrossing,        // partly or completely outside the region
  kWide,            // through the region, vertices at the limit of the coordinates
};
constexpr SceneKind kAllKinds[] = {
    SceneKind::kSoup,     SceneKind::kDegenerate, SceneKind::kSliver,
    SceneKind::kSubVoxel, SceneKind::kWalls,      SceneKind::kDiagonal,
    SceneKind::kSpanning, SceneKind::kCoincident, SceneKind::kThroughCorners,
    SceneKind::kCrossing, SceneKind::kWide};

// Returns the name of a kind: "soup", "degenerate", ...
std::string kind_name(SceneKind kind);

// Random numbers that are the same on every machine, which standard distributions do not guarantee.
class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  // Returns a number from [least, most].
  int64_t between(int64_t least, int64_t most) {
    return least + static_cast<int64_t>(engine_() % static_cast<uint64_t>(most - least + 1));
  }
  bool coin() { return between(0, 1) == 1; }
  // Returns an odd number from [least, most].
  int64_t odd(int64_t least, int64_t most) { return between(least, most - 1) | 1; }

 private:
  std::mt19937_64 engine_;
};

// Returns about `count` triangles of one kind.
Triangles make_scene(SceneKind kind, uint64_t seed, const Region& region, int count);

}  // namespace oracle
