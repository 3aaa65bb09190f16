#include "scene/gltf/document/scene_nodes.h"

#include <algorithm>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

constexpr const char* kListedTwice = "is listed twice; it is drawn once";

Node& node_at(Document& d, int node) { return d.nodes[static_cast<size_t>(node)]; }
const Node& node_at(const Document& d, int node) { return d.nodes[static_cast<size_t>(node)]; }
int node_count(const Document& d) { return static_cast<int>(d.nodes.size()); }
bool node_exists(const Document& d, int node) { return node >= 0 && node < node_count(d); }

void refuse_missing(const Document& d, const std::string& where, const char* what, int index,
                    size_t count) {
  refuse(d.path, where + ": " + what + " " + std::to_string(index) + " does not exist, there are " +
                     std::to_string(count));
}

// Sets the parent of every node: the first node that lists it as a child.
void link_parents(Document& d) {
  for (int i = 0; i < node_count(d); ++i)
    for (const int child : node_at(d, i).children)
      if (node_exists(d, child) && node_at(d, child).parent < 0) node_at(d, child).parent = i;
}

// Refuses a node that is its own ancestor. Follows the chain of parents of every node; a node that
// occurs twice in one chain is in a cycle. A chain stops at a node of an earlier chain, so each
// node is visited once.
void check_for_cycles(const Document& d) {
  std::vector<int> chain_of(d.nodes.size(), -1);
  for (int start = 0; start < node_count(d); ++start) {
    int node = start;
    while (node >= 0 && chain_of[static_cast<size_t>(node)] < 0) {
      chain_of[static_cast<size_t>(node)] = start;
      node = node_at(d, node).parent;
    }
    if (node >= 0 && chain_of[static_cast<size_t>(node)] == start)
      refuse(d.path, d.name_node(node) + " is its own ancestor, expected no cycles");
  }
}

// Marks the nodes for which `is_marked` is true, and all their descendants.
template <class IsMarked>
std::vector<bool> mark_subtrees(const Document& d, const IsMarked& is_marked) {
  std::vector<bool> marks(d.nodes.size()), is_known(d.nodes.size());
  const auto index = [](int node) { return static_cast<size_t>(node); };
  for (int start = 0; start < node_count(d); ++start) {
    int top = start;
    while (top >= 0 && !is_known[index(top)] && !is_marked(top)) top = node_at(d, top).parent;
    const bool mark = top >= 0 && (!is_known[index(top)] || marks[index(top)]);
    for (int node = start;; node = node_at(d, node).parent) {
      if (node < 0 || is_known[index(node)]) break;
      is_known[index(node)] = true;
      marks[index(node)] = mark;
      if (node == top) break;
    }
  }
  return marks;
}

// Returns the nodes of the default scene, or of the first scene if the file names none. Without
// scenes, returns all nodes without a parent.
std::vector<int> listed_nodes(Document& d) {
  if (d.scenes.empty()) {
    std::vector<int> roots;
    for (int i = 0; i < node_count(d); ++i)
      if (node_at(d, i).parent < 0) roots.push_back(i);
    return roots;
  }
  const int scene = std::max(d.scene, 0);
  if (static_cast<size_t>(scene) >= d.scenes.size())
    refuse_missing(d, "the default scene", "scene", scene, d.scenes.size());
  std::vector<int> listed = std::move(d.scenes[static_cast<size_t>(scene)]);
  d.scenes.clear();
  for (const int node : listed)
    if (!node_exists(d, node))
      refuse_missing(d, "scene " + std::to_string(scene), "node", node, d.nodes.size());
  return listed;
}

// Sets the roots: the listed nodes, each once, without descendants of other listed nodes.
void choose_roots(Document& d) {
  const std::string where = "scene " + std::to_string(std::max(d.scene, 0)) + ": ";
  const std::vector<int> listed = listed_nodes(d);
  std::vector<bool> is_listed(d.nodes.size());
  for (const int node : listed) {
    if (is_listed[static_cast<size_t>(node)])
      d.warn("repeated-node", where + d.name_node(node), kListedTwice);
    else
      d.roots.push_back(node);
    is_listed[static_cast<size_t>(node)] = true;
  }
  const std::vector<bool> in_scene =
      mark_subtrees(d, [&](int node) { return is_listed[static_cast<size_t>(node)]; });
  std::erase_if(d.roots, [&](int node) {
    const int parent = node_at(d, node).parent;
    if (parent < 0) return false;
    const bool is_below_root = in_scene[static_cast<size_t>(parent)];
    d.warn("root-with-parent", where + d.name_node(node),
           is_below_root ? "is listed although an ancestor is; it is drawn once"
                         : "is listed although it has a parent; it keeps its parent's transform");
    return is_below_root;
  });
}

// Computes the global transforms of nodes, and stores them, so that each is computed only once.
class AncestorTransforms {
 public:
  explicit AncestorTransforms(Document& document) : document_(document) {}

  const Transform& of(int node) {
    std::vector<int> chain;  // the node and its ancestors whose transform is unknown
    for (int i = node; i >= 0 && !known_.contains(i); i = node_at(document_, i).parent)
      chain.push_back(i);
    for (size_t k = chain.size(); k-- > 0;) {
      const Node& link = node_at(document_, chain[k]);
      document_.charge.add(sizeof(Transform) + kMapBytes);
      known_[chain[k]] =
          link.parent >= 0 ? multiply(known_.at(link.parent), link.local) : link.local;
    }
    return known_.at(node);
  }

 private:
  static constexpr uint64_t kMapBytes = 72;

  Document& document_;
  std::unordered_map<int, Transform> known_;
};

void set_transforms_above_roots(Document& d) {
  AncestorTransforms transforms(d);
  for (const int root : d.roots)
    if (const int parent = node_at(d, root).parent; parent >= 0)
      d.above_roots[root] = transforms.of(parent);
}

// Warns if no node with a mesh is drawn, although the file has nodes with meshes.
void warn_of_missing_meshes(Document& d, const std::vector<bool>& in_scene,
                            const std::vector<bool>& drawn) {
  uint64_t hidden = 0, others = 0;
  for (size_t i = 0; i < d.nodes.size(); ++i) {
    if (d.nodes[i].mesh < 0) continue;
    if (drawn[i]) return;
    ++(in_scene[i] ? hidden : others);
  }
  if (hidden > 0)
    d.warn("hidden-scene", "", "all its nodes with meshes are hidden (KHR_node_visibility)",
           hidden);
  else if (others > 0)
    d.warn("scene-without-meshes", "scene " + std::to_string(std::max(d.scene, 0)),
           "has no nodes with meshes; they are in other scenes or in none", others);
}

// Returns the nodes below the roots, without hidden nodes and their descendants.
std::vector<bool> drawn_nodes(Document& d) {
  std::vector<bool> is_root(d.nodes.size());
  for (const int root : d.roots) is_root[static_cast<size_t>(root)] = true;
  const std::vector<bool> in_scene =
      mark_subtrees(d, [&](int node) { return is_root[static_cast<size_t>(node)]; });
  std::vector<bool> drawn = mark_subtrees(d, [&](int node) { return node_at(d, node).is_hidden; });
  for (size_t i = 0; i < drawn.size(); ++i) drawn[i] = in_scene[i] && !drawn[i];
  warn_of_missing_meshes(d, in_scene, drawn);
  return drawn;
}

// Checks the children of node `i`. Removes children that are not drawn, and repetitions of a child.
// `seen` marks the children found so far.
void check_children(Document& d, int i, const std::vector<bool>& drawn, std::vector<bool>& seen) {
  const bool is_drawn = drawn[static_cast<size_t>(i)];
  std::erase_if(node_at(d, i).children, [&](int child) {
    if (!node_exists(d, child)) {
      if (is_drawn) refuse_missing(d, d.name_node(i), "child node", child, d.nodes.size());
      return true;
    }
    const auto index = static_cast<size_t>(child);
    if (node_at(d, child).parent != i) {
      if (is_drawn || drawn[index])
        refuse(d.path, d.name_node(child) + " has two parents, " +
                           d.name_node(node_at(d, child).parent) + " and " + d.name_node(i) +
                           ", expected one at most");
      return true;
    }
    const bool is_repeated = seen[index];
    if (is_repeated)
      d.warn("repeated-node", d.name_node(i) + ": " + d.name_node(child), kListedTwice);
    seen[index] = true;
    return is_repeated || !drawn[index];
  });
}

}  // namespace

void link_scene(Document& d) {
  link_parents(d);
  check_for_cycles(d);
  choose_roots(d);
  set_transforms_above_roots(d);
  const std::vector<bool> drawn = drawn_nodes(d);
  std::vector<bool> seen(d.nodes.size());
  for (int i = 0; i < node_count(d); ++i) check_children(d, i, drawn, seen);
  std::erase_if(d.roots, [&](int root) { return !drawn[static_cast<size_t>(root)]; });
}

}  // namespace voxdag::gltf
