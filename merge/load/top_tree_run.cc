#include "merge/load/top_tree_run.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"
#include "core/dag/node_hash.h"
#include "core/geometry/morton.h"

namespace voxdag {
namespace {

uint64_t morton_of(const PlacedNode& node) {
  return morton_encode(node.cube.position[0], node.cube.position[1], node.cube.position[2]);
}

std::string describe(const Cube& cube) {
  return "level " + std::to_string(cube.level) + ", position (" + std::to_string(cube.position[0]) +
         ", " + std::to_string(cube.position[1]) + ", " + std::to_string(cube.position[2]) + ")";
}

}  // namespace

TopTreeRun::TopTreeRun(uint32_t hash_bits, std::vector<PlacedNode> children, bool wide)
    : LevelRun({.bricks = false, .wide = wide}, true) {
  std::ranges::sort(children, {}, morton_of);
  add_parents(children, hash_bits);
  std::ranges::sort(nodes_, [](const Node& a, const Node& b) {
    if (a.hash != b.hash) return a.hash < b.hash;
    if (a.mask != b.mask) return a.mask < b.mask;
    return std::ranges::lexicographical_compare(a.child_span(), b.child_span());
  });
  divide_into_frames();
}

// Adds a node for each parent of `children`, which are in Morton order. So the children of one
// parent are adjacent and in child order.
void TopTreeRun::add_parents(const std::vector<PlacedNode>& children, uint32_t hash_bits) {
  for (size_t begin = 0, end; begin < children.size(); begin = end) {
    Node node;
    node.cube = children[begin].cube.parent();
    uint64_t hashes[8];
    int count = 0;
    for (end = begin; end < children.size() && children[end].cube.parent() == node.cube; ++end) {
      const PlacedNode& child = children[end];
      const uint8_t bit = static_cast<uint8_t>(1 << child.cube.child_index());
      if (node.mask & bit)
        throw Error(ErrorCode::kCorrupt, "two artifacts hold the cube at " + describe(child.cube) +
                                             ", or one holds it and another a part of it: "
                                             "expected subvolumes that do not overlap");
      node.mask |= bit;
      node.children[count] = child.position;
      hashes[count++] = child.hash;
    }
    node.hash = truncate_hash(hash_node(node.mask, hashes), hash_bits);
    nodes_.push_back(node);
  }
}

void TopTreeRun::divide_into_frames() {
  uint64_t children = 0;
  for (size_t row = 0; row < nodes_.size(); ++row) {
    if (row % kFrameRows == 0) {
      FrameInfo frame;
      frame.first_row = row;
      frame.first_child = children;
      frame.first_hash = nodes_[row].hash;
      infos_.push_back(frame);
    }
    ++infos_.back().rows;
    infos_.back().children += kPopcount8[nodes_[row].mask];
    children += kPopcount8[nodes_[row].mask];
  }
  set_frames(infos_, nodes_.size(), children);
}

void TopTreeRun::read_frame(size_t index, Frame& out) const {
  out.rows = infos_[index].rows;
  out.hashes.clear();
  out.masks.clear();
  out.children.clear();
  const auto first = nodes_.begin() + static_cast<std::ptrdiff_t>(infos_[index].first_row);
  for (auto node = first; node != first + out.rows; ++node) {
    out.hashes.push_back(node->hash);
    out.masks.push_back(node->mask);
    uint32_t words[kMaxRowWords];
    uint32_t* end = words;
    for (const uint64_t child : node->child_span()) end = put_position(end, child, format().wide);
    out.children.insert(out.children.end(), words, end);
  }
}

}  // namespace voxdag
