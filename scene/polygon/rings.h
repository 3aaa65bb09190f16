// The rings of corners into which diagonals divide a polygon. At first, all corners form one ring.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace voxdag::polygon {

// A corner in a ring. A corner where diagonals end is in several rings, once in each.
struct RingNode {
  uint32_t corner, previous, next;  // `previous` and `next` are nodes
};

class Rings {
 public:
  // Makes one ring. Node i is corner i.
  void reset(uint32_t corners) {
    nodes_.clear();
    nodes_.reserve(3 * size_t{corners});  // the corners, and two nodes per diagonal
    for (uint32_t i = 0; i < corners; ++i)
      nodes_.push_back({i, i == 0 ? corners - 1 : i - 1, i + 1 == corners ? 0 : i + 1});
  }

  size_t size() const { return nodes_.size(); }
  const RingNode& operator[](uint32_t node) const { return nodes_[node]; }

  // Divides the ring that contains nodes `from` and `to` by a diagonal between them. In one of the
  // two new rings, `to` follows `from`. Returns the new node that represents the corner of `to` in
  // the other ring. The edge that ended at `to` now ends at this new node.
  uint32_t divide(uint32_t from, uint32_t to) {
    const auto new_from = static_cast<uint32_t>(nodes_.size()), new_to = new_from + 1;
    const uint32_t after_from = nodes_[from].next, before_to = nodes_[to].previous;
    nodes_.push_back({nodes_[from].corner, new_to, after_from});
    nodes_.push_back({nodes_[to].corner, before_to, new_from});
    nodes_[after_from].previous = new_from;
    nodes_[before_to].next = new_to;
    nodes_[from].next = to;
    nodes_[to].previous = from;
    return new_to;
  }

  // Removes a node from its ring.
  void remove(uint32_t node) {
    nodes_[nodes_[node].previous].next = nodes_[node].next;
    nodes_[nodes_[node].next].previous = nodes_[node].previous;
  }

 private:
  std::vector<RingNode> nodes_;
};

}  // namespace voxdag::polygon
