// Finds the artifact that has the voxels of a cube of the grid.
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
    kEmpty,   // no root of an artifact overlaps the cube, so it has no voxels
    kInside,  // the cube is inside the cube of one root
    kDivided  // the cube contains smaller cubes of roots
  };
  struct Place {
    Kind kind = Kind::kEmpty;
    ArtifactRef artifact;  // kInside
  };

  // Reads the roots of all parts' artifacts.
  ArtifactTree(const WorkFolder& work, std::span<const FilledPart> parts, MemoryBudget& budget);

  Place find(const Cube& cube) const;

 private:
  // The cubes of the roots that overlap the parts, and their artifacts. If the cube of a root is
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
