#include "scheduler/stages/enclose/artifact_tree.h"

#include <map>
#include <memory>

#include "core/format/artifact/artifact_reader.h"
#include "core/geometry/octree_descent.h"

namespace voxdag {

ArtifactTree::Roots ArtifactTree::read_roots(const WorkFolder& work,
                                             std::span<const FilledPart> parts) {
  Roots out;
  std::map<uint32_t, std::shared_ptr<ReadableFile>> segments;
  for (const FilledPart& part : parts) {
    auto& segment = segments[part.artifact.segment];
    if (!segment) segment = work.open_segment(part.artifact.segment);
    const ArtifactReader artifact(segment, part.artifact);
    for (const ArtifactRoot& root : artifact.roots()) {
      if (!contains(root.cube, part.cube) && !contains(part.cube, root.cube)) continue;
      out.cubes.push_back(root.cube.level < part.cube.level ? part.cube : root.cube);
      out.artifacts.push_back(part.artifact);
    }
  }
  return out;
}

ArtifactTree::ArtifactTree(const WorkFolder& work, std::span<const FilledPart> parts,
                           MemoryBudget& budget)
    : roots_(read_roots(work, parts)),
      tree_(roots_.cubes),
      charge_(budget, tree_.bytes() + roots_.cubes.size() * (sizeof(Cube) + sizeof(ArtifactRef)),
              "the cubes of the grid") {}

ArtifactTree::Place ArtifactTree::find(const Cube& cube) const {
  PartTree::Ref ref = tree_.root();
  for (uint32_t level = 1; !ref.is_leaf; ++level) {
    if (level > cube.level) return {Kind::kDivided, {}};
    ref = tree_.child(ref, ancestor(cube, level).child_index());
  }
  const uint32_t part = tree_.leaves()[ref.index].part;
  if (part == PartTree::kEmpty) return {};
  return {Kind::kInside, roots_.artifacts[part]};
}

}  // namespace voxdag
