// The CPU backend in its plainest form: cubes are split in eight as long as triangles touch them,
// bricks are filled voxel by voxel, equal nodes found through hash tables.
#include <algorithm>
#include <optional>
#include <unordered_map>
#include <vector>

#include "core/backend/backend.h"
#include "core/base/page_buffer.h"
#include "core/dag/brick.h"
#include "core/dag/node_hash.h"
#include "core/geometry/morton.h"
#include "core/geometry/overlap.h"

namespace voxdag {
namespace {

constexpr int kTileLevels = 6;           // triangles are handed down to tiles of 64^3 voxels
constexpr uint64_t kBytesPerNode = 160;  // a Node, its place in the table, its place in the order
constexpr size_t kBatch = 256;           // triangles read at once

struct OutgrownSignal {};

struct Node {
  uint64_t hash = 0;  // uncut
  uint64_t mask = 0;  // child mask; the voxels of a brick
  uint32_t children[8] = {};
  bool operator==(const Node& o) const {
    return mask == o.mask && std::equal(children, children + 8, o.children);
  }
};

// The unique nodes of one level.
class Level {
 public:
  uint32_t find_or_add(const Node& node, MemoryCharge& charge) {
    auto [it, end] = index_.equal_range(node.hash);
    for (; it != end; ++it)
      if (nodes[it->second] == node) return it->second;
    if (!charge.try_resize(charge.bytes() + kBytesPerNode)) throw OutgrownSignal{};
    const uint32_t id = static_cast<uint32_t>(nodes.size());
    nodes.push_back(node);
    index_.emplace(node.hash, id);
    return id;
  }
  std::vector<Node> nodes;

 private:
  std::unordered_multimap<uint64_t, uint32_t> index_;
};

// One subvolume being built.
class Build {
 public:
  Build(const SubvolumeTask& task, MemoryBudget& budget, const CancelToken& cancel)
      : task_(task),
        levels_(task.grid_levels - kBrickLevels - task.cube.level + 1),
        charge_(budget, 64 << 10, "the CPU backend's tile"),
        budget_(budget),
        cancel_(cancel),
        tile_(4096) {}

  SubDagSummary run(TriangleStream& stream, SubDagSink& sink) {
    std::optional<uint32_t> root;
    stream.rewind();
    const int cube_levels = static_cast<int>(task_.grid_levels - task_.cube.level);
    if (cube_levels <= kTileLevels) {
      root = stream_tile(stream, cube_levels);
    } else {
      if (!charge_.try_resize(charge_.bytes() + stream.count() * sizeof(FixedTriangle)))
        throw OutgrownSignal{};
      std::vector<FixedTriangle> triangles(stream.count());
      size_t filled = 0;
      while (const size_t n = stream.read(std::span(triangles).subspan(filled))) filled += n;
      triangles.resize(filled);
      std::vector<const FixedTriangle*> all;
      for (const FixedTriangle& t : triangles) all.push_back(&t);
      root = build(task_.cube, all);
    }
    if (!root) return {};
    for (const Level& level : levels_) summary_.dag_nodes += level.nodes.size();
    emit(sink);
    return summary_;
  }

 private:
  int64_t edge_units(const Cube& cube) const {
    return cube.edge_voxels(task_.grid_levels) * kUnitsPerVoxel;
  }
  bool touches(const FixedTriangle& t, const Cube& cube) const {
    const int64_t edge = edge_units(cube);
    const int64_t low[3] = {cube.position[0] * edge, cube.position[1] * edge,
                            cube.position[2] * edge};
    return triangle_touches_cube(t, low, edge);
  }

  std::optional<uint32_t> stream_tile(TriangleStream& stream, int cube_levels) {
    std::vector<FixedTriangle> batch(kBatch);
    while (const size_t n = stream.read(batch)) {
      cancel_.check();
      for (size_t i = 0; i < n; ++i)
        if (touches(batch[i], task_.cube)) raster(batch[i], task_.cube, cube_levels, 0);
    }
    return reduce(cube_levels, 0);
  }

  std::optional<uint32_t> build(const Cube& cube,
                                const std::vector<const FixedTriangle*>& parents) {
    std::vector<const FixedTriangle*> inside;
    for (const FixedTriangle* t : parents)
      if (touches(*t, cube)) inside.push_back(t);
    MemoryCharge list;
    if (inside.empty()) return {};
    list = MemoryCharge(budget_, 0, "triangle list");
    if (!list.try_resize(inside.size() * sizeof(inside[0]))) throw OutgrownSignal{};
    const int cube_levels = static_cast<int>(task_.grid_levels - cube.level);
    if (cube_levels <= kTileLevels) {
      cancel_.check();
      for (const FixedTriangle* t : inside) raster(*t, cube, cube_levels, 0);
      return reduce(cube_levels, 0);
    }
    std::optional<uint32_t> children[8];
    for (int c = 0; c < 8; ++c) children[c] = build(cube.child(c), inside);
    return add_node(cube_levels, children);
  }

  // `cube` is known to be touched; `first` is its first brick's Morton code within the tile.
  void raster(const FixedTriangle& t, const Cube& cube, int cube_levels, uint32_t first) {
    if (cube_levels == kBrickLevels) {
      const int64_t voxel = kUnitsPerVoxel, brick = voxel * kBrickEdge;
      for (uint32_t bit = 0; bit < 64; ++bit) {
        uint32_t k[3];
        morton_decode(bit, k[0], k[1], k[2]);
        int64_t low[3];
        for (int a = 0; a < 3; ++a) low[a] = cube.position[a] * brick + k[a] * voxel;
        if (!(tile_[first] >> bit & 1) && triangle_touches_cube(t, low, voxel))
          tile_[first] |= uint64_t{1} << bit;
      }
      return;
    }
    for (int c = 0; c < 8; ++c)
      if (const Cube child = cube.child(c); touches(t, child))
        raster(t, child, cube_levels - 1, first * 8 + c);
  }

  // The node of the tile's bricks from Morton code `first` on; clears them.
  std::optional<uint32_t> reduce(int cube_levels, uint32_t first) {
    if (cube_levels == kBrickLevels) {
      const uint64_t mask = std::exchange(tile_[first], 0);
      if (mask == 0) return {};
      summary_.voxels += popcount64(mask);
      ++summary_.svo_nodes;
      return levels_[0].find_or_add({hash_brick(mask), mask, {}}, charge_);
    }
    std::optional<uint32_t> children[8];
    for (int c = 0; c < 8; ++c) children[c] = reduce(cube_levels - 1, first * 8 + c);
    return add_node(cube_levels, children);
  }

  std::optional<uint32_t> add_node(int cube_levels, const std::optional<uint32_t> (&children)[8]) {
    const Level& below = levels_[cube_levels - kBrickLevels - 1];
    Node node;
    uint64_t hashes[8];
    int count = 0;
    for (int c = 0; c < 8; ++c)
      if (children[c]) {
        node.mask |= 1u << c;
        node.children[count] = *children[c];
        hashes[count++] = below.nodes[*children[c]].hash;
      }
    if (count == 0) return {};
    ++summary_.svo_nodes;
    node.hash = hash_node(static_cast<uint32_t>(node.mask), hashes);
    return levels_[cube_levels - kBrickLevels].find_or_add(node, charge_);
  }

  // Sorts each level into the total order, with cut hashes, and hands it over.
  void emit(SubDagSink& sink) {
    std::vector<uint32_t> new_index;
    std::vector<uint64_t> child_hashes;
    for (size_t l = 0; l < levels_.size(); ++l) {
      std::vector<Node>& nodes = levels_[l].nodes;
      for (Node& node : nodes) rewire(node, l == 0, new_index, child_hashes);
      std::vector<uint32_t> order(nodes.size());
      for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
      std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        if (nodes[a].hash != nodes[b].hash) return nodes[a].hash < nodes[b].hash;
        if (nodes[a].mask != nodes[b].mask) return nodes[a].mask < nodes[b].mask;
        return std::lexicographical_compare(nodes[a].children, nodes[a].children + 8,
                                            nodes[b].children, nodes[b].children + 8);
      });
      new_index.resize(order.size());
      for (uint32_t i = 0; i < order.size(); ++i) new_index[order[i]] = i;
      hand_over(static_cast<uint32_t>(task_.grid_levels - kBrickLevels - l), nodes, order, sink);
      child_hashes.clear();
      for (const uint32_t i : order) child_hashes.push_back(nodes[i].hash);
    }
    summary_.root_hash = child_hashes[0];
  }

  void rewire(Node& node, bool brick, const std::vector<uint32_t>& new_index,
              const std::vector<uint64_t>& child_hashes) const {
    if (!brick) {
      uint64_t hashes[8];
      for (int c = 0; c < popcount64(node.mask); ++c) {
        node.children[c] = new_index[node.children[c]];
        hashes[c] = child_hashes[node.children[c]];
      }
      node.hash = hash_node(static_cast<uint32_t>(node.mask), hashes);
    }
    node.hash = cut_hash(node.hash, task_.hash_bits);
  }

  void hand_over(uint32_t level, const std::vector<Node>& nodes, const std::vector<uint32_t>& order,
                 SubDagSink& sink) const {
    if (level == task_.grid_levels - kBrickLevels) {
      std::vector<uint64_t> masks;
      for (const uint32_t i : order) masks.push_back(nodes[i].mask);
      return sink.bricks({masks});
    }
    std::vector<uint64_t> hashes;
    std::vector<uint8_t> masks;
    std::vector<uint32_t> children;
    for (const uint32_t i : order) {
      hashes.push_back(nodes[i].hash);
      masks.push_back(static_cast<uint8_t>(nodes[i].mask));
      children.insert(children.end(), nodes[i].children,
                      nodes[i].children + popcount64(nodes[i].mask));
    }
    sink.nodes({level, hashes, masks, children});
  }

  const SubvolumeTask task_;
  std::vector<Level> levels_;  // [0] the bricks
  MemoryCharge charge_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  std::vector<uint64_t> tile_;  // bricks in Morton order
  SubDagSummary summary_;
};

class CpuBackend : public Backend {
 public:
  std::string_view name() const override { return "cpu"; }
  BuildOutcome build(const SubvolumeTask& task, TriangleStream& triangles, MemoryBudget& budget,
                     const CancelToken& cancel, SubDagSink& sink, SubDagSummary& summary) override {
    try {
      summary = Build(task, budget, cancel).run(triangles, sink);
      return BuildOutcome::kBuilt;
    } catch (const OutgrownSignal&) {
      return BuildOutcome::kOutgrown;
    }
  }
};

}  // namespace

std::unique_ptr<Backend> make_cpu_backend(bool) { return std::make_unique<CpuBackend>(); }

}  // namespace voxdag
