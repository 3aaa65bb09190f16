#include "core/scene/gltf/document/hierarchy.h"

#include <algorithm>

#include "core/scene/gltf/document/accessor_checks.h"
#include "core/scene/gltf/messages.h"

namespace voxdag::gltf {
namespace {

// Follows the parents of every node; a node that occurs twice in one chain is in a cycle. A chain
// stops at a node of an earlier chain, so each node is visited once.
void check_for_cycles(const Document& d) {
  std::vector<int> chain_of(d.nodes.size(), -1);
  for (int start = 0; start < static_cast<int>(d.nodes.size()); ++start) {
    int node = start;
    while (node >= 0 && chain_of[static_cast<size_t>(node)] < 0) {
      chain_of[static_cast<size_t>(node)] = start;
      node = d.nodes[static_cast<size_t>(node)].parent;
    }
    if (node >= 0 && chain_of[static_cast<size_t>(node)] == start)
      refuse(d.path, d.name_node(node) + " is its own ancestor, expected no cycles");
  }
}

}  // namespace

void link_parents(Document& d) {
  for (int i = 0; i < static_cast<int>(d.nodes.size()); ++i) {
    for (int child : d.nodes[static_cast<size_t>(i)].children) {
      check_index(d, d.nodes.size(), child, d.name_node(i), "child node");
      int& parent = d.nodes[static_cast<size_t>(child)].parent;
      if (parent >= 0)
        refuse(d.path, d.name_node(child) + " has two parents, " + d.name_node(parent) + " and " +
                           d.name_node(i) + ", expected one at most");
      parent = i;
    }
  }
  check_for_cycles(d);
}

void choose_scene(Document& d) {
  if (d.scenes.empty()) {
    for (int i = 0; i < static_cast<int>(d.nodes.size()); ++i)
      if (d.nodes[static_cast<size_t>(i)].parent < 0) d.roots.push_back(i);
    return;
  }
  const int scene = std::max(d.scene, 0);
  const std::string where = "scene " + std::to_string(scene);
  check_index(d, d.scenes.size(), scene, "the default scene", "scene");
  d.roots = std::move(d.scenes[static_cast<size_t>(scene)]);
  d.scenes.clear();
  std::vector<bool> seen(d.nodes.size());
  for (int root : d.roots) {
    check_index(d, d.nodes.size(), root, where, "node");
    const int parent = d.nodes[static_cast<size_t>(root)].parent;
    if (parent >= 0)
      refuse(d.path, where + ": " + d.name_node(root) + " is no root, its parent is " +
                         d.name_node(parent));
    if (seen[static_cast<size_t>(root)])
      refuse(d.path, where + ": " + d.name_node(root) + " is listed twice");
    seen[static_cast<size_t>(root)] = true;
  }
}

}  // namespace voxdag::gltf
