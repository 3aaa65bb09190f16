// The sub-DAGs of artifacts, found by their cubes.
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
    kEmpty,   // no root's cube meets the cube
    kInside,  // the cube is in the cube of one root
    kDivided  // the cubes of roots are inside the cube
  };
  struct Place {
    Kind kind = Kind::kEmpty;
    ArtifactRef artifact;  // kInside
  };

  // Reads the roots of all parts' artifacts.
  ArtifactTree(const WorkFolder& work, std::span<const FilledPart> parts, MemoryBudget& budget);

  Place find(const Cube& cube) const;

 private:
  // The roots inside the cubes of parts. If a part's cube is inside the cube of a root, the part's
  // cube.
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
