// The hash table of a backend can store only the upper 32 bits of a hash. Different nodes whose
// hashes have equal upper 32 bits must remain different nodes.
#include <unordered_map>

#include "tests/conformance/harness.h"

namespace voxdag {
namespace {

using Collisions = Conformance;
VOXDAG_FOR_ALL_BACKENDS(Collisions);

// A node with one child, a brick.
struct SmallNode {
  int child;
  uint64_t brick;
};

// Returns pairs of different nodes, one pair after the other, whose hashes have equal upper halves.
// Finds the pairs by trying random nodes.
std::vector<SmallNode> colliding_nodes() {
  std::unordered_map<uint32_t, SmallNode> by_half_hash;
  std::vector<SmallNode> found;
  oracle::Random random(51);
  for (int i = 0; i < 400000; ++i) {
    SmallNode node{i % 8, 0};
    for (int voxel = 0; voxel < 6; ++voxel) node.brick |= uint64_t{1} << random.between(0, 63);
    const uint64_t hash = oracle::node_hash(1u << node.child, {oracle::brick_hash(node.brick)});
    const auto [at, is_new] = by_half_hash.emplace(static_cast<uint32_t>(hash >> 32), node);
    const SmallNode& other = at->second;
    if (is_new || (other.child == node.child && other.brick == node.brick)) continue;
    found.push_back(other);
    found.push_back(node);
  }
  return found;
}

// Adds a triangle in every voxel of the node's brick. `index`, from 0 to 63, is the number of the
// node's cube: the grid has 4^3 cubes of 8 voxels per edge.
void place(const SmallNode& node, int index, oracle::Triangles& scene) {
  for (int bit = 0; bit < 64; ++bit) {
    if (!(node.brick >> bit & 1)) continue;
    oracle::Point p;
    for (int a = 0; a < 3; ++a) {
      const int shift = 2 - a;  // x has the highest bit of each group of three
      const int voxel = 2 * (bit >> (3 + shift) & 1) + (bit >> shift & 1);
      const int cell = index / (a == 0 ? 16 : a == 1 ? 4 : 1) % 4;
      p[a] = 256 * (8 * cell + 4 * (node.child >> shift & 1) + voxel) + 101;
    }
    scene.push_back({p, {p[0] + 20, p[1], p[2]}, {p[0], p[1] + 20, p[2]}});
  }
}

TEST_P(Collisions, HalfAHashIsNotIdentity) {
  const auto nodes = colliding_nodes();
  ASSERT_GE(nodes.size(), 4u);
  oracle::Triangles scene;
  for (size_t i = 0; i < std::min<size_t>(nodes.size(), 64); ++i)
    place(nodes[i], static_cast<int>(i), scene);
  for (const uint32_t hash_bits : {4u, 32u, 64u})
    expect_right(*open(), {5, Cube{}, hash_bits}, scene);
}

}  // namespace
}  // namespace voxdag
