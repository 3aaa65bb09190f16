// Finds the artifact that has the voxels of a cube of the grid. An artifact can have several roots.
// Each root represents the voxels of one cube of the grid, the *root cube*. If a part (FilledPart)
// is smaller than a root cube around it, the cube of the part takes the place of the root cube.
// find() compares its argument with the root cubes of all artifacts.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/memory_budget.h"
#include "scheduler/solid/filled_parts.h"
#include "scheduler/stages/enclose/part_tree.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {

class ArtifactTree {
 public:
  enum class Kind : uint8_t {
    kEmpty,   // the argument overlaps no root cube, so it has no voxels
    kInside,  // the argument is a root cube, or is inside a root cube
    kDivided  // the argument contains root cubes that are smaller
  };
  struct Place {
    Kind kind = Kind::kEmpty;
    ArtifactRef artifact;  // the artifact with this root cube; only for kInside
  };

  // Reads the roots of all parts' artifacts.
  ArtifactTree(const WorkFolder& work, std::span<const FilledPart> parts, MemoryBudget& budget);

  Place find(const Cube& cube) const;

 private:
  // The root cubes that overlap the parts, and the artifact of each root cube. If a root cube is
  // larger than the part, `cubes` has the cube of the part instead.
  struct Roots {
    std::vector<Cube> cubes;
    std::vector<ArtifactRef> artifacts;
  };
  static Roots read_roots(const WorkFolder& work, std::span<const FilledPart> parts);

  const Roots roots_;
  const PartTree tree_;
  const MemoryCharge charge_;
};

}  // namespace voxdag
