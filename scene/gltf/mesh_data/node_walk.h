// Visits the nodes of the scene that draw a mesh, with their global transforms: parents before
// children, children in the order of the file. The memory of the walk grows with the depth of the
// hierarchy. The walk is not recursive, so that a deep hierarchy does not overflow the stack.
#pragma once

#include <vector>

#include "scene/gltf/document/document.h"

namespace voxdag::gltf {

class NodeWalk {
 public:
  NodeWalk(const Document& document, MemoryBudget& budget);

  // Moves to the next node with a mesh. Returns false at the end.
  bool next();
  int node() const { return path_.back().node; }
  const Transform& global() const { return path_.back().global; }

 private:
  struct Step {
    int node;
    size_t next_child;
    Transform global;
  };

  bool descend();
  void enter(int node, const Transform& global);
  const Node& node_at(int i) const { return document_.nodes[static_cast<size_t>(i)]; }

  const Document& document_;
  std::vector<Step> path_;  // the nodes from a root to the current node
  GrowingCharge charge_;
  size_t next_root_ = 0;
};

}  // namespace voxdag::gltf
