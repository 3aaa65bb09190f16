#include "tests/oracle/dag.h"

#include <map>
#include <utility>

namespace oracle {
namespace {

constexpr uint32_t kNothing = 0xffffffff;

// Multiplies 64 x 64 bits to 128 bits by long multiplication, and returns the XOR of the two
// halves.
uint64_t fold(uint64_t a, uint64_t b) {
  const uint64_t a0 = a & 0xffffffff, a1 = a >> 32, b0 = b & 0xffffffff, b1 = b >> 32;
  const uint64_t middle = a1 * b0 + (a0 * b0 >> 32);
  const uint64_t middle2 = a0 * b1 + (middle & 0xffffffff);
  const uint64_t high = a1 * b1 + (middle >> 32) + (middle2 >> 32);
  return (a * b) ^ high;
}

// The nodes of one octree level: for the cell (x, y, z), the index of its node in the level array.
struct Places {
  explicit Places(int edge_) : edge(edge_), node(static_cast<size_t>(edge_) * edge_ * edge_) {}
  uint32_t& at(int x, int y, int z) { return node[(static_cast<size_t>(x) * edge + y) * edge + z]; }
  int edge;
  std::vector<uint32_t> node;
};

uint64_t brick_at(const Voxels& voxels, int x, int y, int z) {
  uint64_t mask = 0;
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j)
      for (int k = 0; k < 4; ++k)
        if (voxels.at(4 * x + i, 4 * y + j, 4 * z + k)) {
          const int high = 4 * (i / 2) + 2 * (j / 2) + k / 2,
                    low = 4 * (i % 2) + 2 * (j % 2) + k % 2;
          mask |= uint64_t{1} << (8 * high + low);
        }
  return mask;
}

Node node_above(Places& below, const std::vector<uint64_t>& hashes, int x, int y, int z, int bits) {
  Node node;
  std::vector<uint64_t> child_hashes;
  for (int c = 0; c < 8; ++c) {
    const uint32_t child = below.at(2 * x + c / 4, 2 * y + c / 2 % 2, 2 * z + c % 2);
    if (child == kNothing) continue;
    node.mask |= 1u << c;
    node.children.push_back(child);
    child_hashes.push_back(hashes[child]);
  }
  node.hash = truncated(node_hash(node.mask, child_hashes), bits);
  return node;
}

// Returns the keys of `wanted` in order. `wanted` has the cells of each key, as indices into
// places.node. Sets each of these cells to the index of its key in the result.
template <class Key>
std::vector<Key> number(const std::map<Key, std::vector<size_t>>& wanted, Places& places) {
  std::vector<Key> sorted;
  for (const auto& [key, where] : wanted) {
    for (const size_t w : where) places.node[w] = static_cast<uint32_t>(sorted.size());
    sorted.push_back(key);
  }
  return sorted;
}

// Calls visit(place, x, y, z) for every cell of a level; `place` is the index of the cell.
template <class Visit>
void for_each_place(int edge, const Visit& visit) {
  size_t place = 0;
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z) visit(place++, x, y, z);
}

}  // namespace

uint64_t brick_hash(uint64_t mask) {
  uint64_t h = mask ^ 0x9e3779b97f4a7c15;
  h = (h ^ (h >> 32)) * 0xd6e8feb86659fd93;
  h = (h ^ (h >> 29)) * 0xa0761d6478bd642f;
  return h ^ (h >> 32);
}

uint64_t node_hash(uint32_t mask, const std::vector<uint64_t>& child_hashes) {
  uint64_t h = (mask * 0x9e3779b97f4a7c15) ^ 0xe7037ed1a0b428db;
  for (const uint64_t child : child_hashes)
    h = fold(h ^ child, 0x8ebc6af09c88c6e3) + 0x589965cc75374cc3;
  return fold(h, 0x1d8e4e27c47d124f);
}

uint64_t truncated(uint64_t hash, int bits) {
  return bits == 64 ? hash : hash >> (64 - bits) << (64 - bits);
}

Dag build_dag(const Voxels& voxels, int hash_bits) {
  Dag dag;
  dag.voxels = voxels.count();
  if (dag.voxels == 0) return dag;

  Places places(voxels.edge() / 4);
  places.node.assign(places.node.size(), kNothing);
  std::map<std::pair<uint64_t, uint64_t>, std::vector<size_t>> bricks;  // (hash, mask)
  for_each_place(places.edge, [&](size_t place, int x, int y, int z) {
    if (const uint64_t mask = brick_at(voxels, x, y, z)) {
      bricks[{truncated(brick_hash(mask), hash_bits), mask}].push_back(place);
      ++dag.svo_nodes;
    }
  });
  std::vector<uint64_t> hashes;
  for (const auto& [hash, mask] : number(bricks, places)) {
    hashes.push_back(hash);
    dag.bricks.push_back(mask);
  }
  dag.dag_nodes = dag.bricks.size();

  while (places.edge > 1) {
    Places above(places.edge / 2);
    above.node.assign(above.node.size(), kNothing);
    std::map<Node, std::vector<size_t>> nodes;
    for_each_place(above.edge, [&](size_t place, int x, int y, int z) {
      const Node node = node_above(places, hashes, x, y, z, hash_bits);
      if (node.mask == 0) return;
      nodes[node].push_back(place);
      ++dag.svo_nodes;
    });
    dag.levels.push_back(number(nodes, above));
    dag.dag_nodes += nodes.size();
    hashes.clear();
    for (const Node& node : dag.levels.back()) hashes.push_back(node.hash);
    places = above;
  }
  dag.root_hash = hashes[0];
  return dag;
}

}  // namespace oracle
