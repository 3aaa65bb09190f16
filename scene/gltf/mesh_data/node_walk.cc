#include "scene/gltf/mesh_data/node_walk.h"

namespace voxdag::gltf {

NodeWalk::NodeWalk(const Document& document, MemoryBudget& budget)
    : document_(document), charge_(budget, "the node hierarchy of " + document.path) {}

bool NodeWalk::next() {
  while (descend())
    if (node_at(node()).mesh >= 0) return true;
  return false;
}

// Takes one step of a depth-first walk: to the next child if one is left, else to the next root.
bool NodeWalk::descend() {
  while (!path_.empty()) {
    Step& step = path_.back();
    const std::vector<int>& children = node_at(step.node).children;
    if (step.next_child < children.size()) {
      const int child = children[step.next_child++];
      enter(child, multiply(step.global, node_at(child).local));
      return true;
    }
    path_.pop_back();
  }
  if (next_root_ == document_.roots.size()) return false;
  const int root = document_.roots[next_root_++];
  const auto above = document_.above_roots.find(root);
  enter(root, above == document_.above_roots.end() ? node_at(root).local
                                                   : multiply(above->second, node_at(root).local));
  return true;
}

void NodeWalk::enter(int node, const Transform& global) {
  path_.push_back({node, 0, global});
  // Charges 3/2 of the new memory: while a vector grows, its old memory, which is half of the new
  // memory, also exists.
  charge_.grow_to(path_.capacity() * sizeof(Step) * 3 / 2);
}

}  // namespace voxdag::gltf
