// Converts the oracle's plain types to voxdag's types and back, for tests that compare the two. The
// oracle itself never includes this header.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "core/backend/backend.h"
#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "core/geometry/fixed_triangle.h"
#include "tests/oracle/dag.h"

namespace oracle {

inline voxdag::FixedTriangle fixed(const Triangle& t) {
  voxdag::FixedTriangle out;
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) out.v[i][a] = t[i][a];
  return out;
}

inline std::vector<voxdag::FixedTriangle> fixed(const Triangles& triangles) {
  std::vector<voxdag::FixedTriangle> out;
  for (const Triangle& t : triangles) out.push_back(fixed(t));
  return out;
}

// Returns the voxels of a cube in a grid of 2^grid_levels voxels per edge.
inline Region region_of(const voxdag::Cube& cube, uint32_t grid_levels) {
  const int64_t edge = cube.edge_voxels(grid_levels);
  return {{cube.position[0] * edge, cube.position[1] * edge, cube.position[2] * edge},
          static_cast<int>(edge)};
}

inline voxdag::SubDag as_sub_dag(const Dag& dag, uint32_t grid_levels) {
  voxdag::SubDag out;
  out.brick_masks = dag.bricks;
  uint32_t level = grid_levels - 2;
  for (const std::vector<Node>& nodes : dag.levels) {
    voxdag::SubDag::Nodes& to = out.levels.emplace_back();
    to.level = --level;
    for (const Node& node : nodes) {
      to.hashes.push_back(node.hash);
      to.masks.push_back(static_cast<uint8_t>(node.mask));
      to.children.insert(to.children.end(), node.children.begin(), node.children.end());
    }
  }
  return out;
}

// Passes a sub-DAG to a sink, in the order in which a backend does.
inline void send(const voxdag::SubDag& dag, voxdag::SubDagSink& sink) {
  if (dag.brick_masks.empty()) return;
  sink.bricks({dag.brick_masks});
  for (const auto& nodes : dag.levels) sink.nodes(nodes.view());
}

inline voxdag::SubDagSummary summary_of(const Dag& dag) {
  return {dag.voxels, dag.svo_nodes, dag.dag_nodes, dag.root_hash};
}

// Streams triangles from memory, at most `batch` per read.
class VectorStream : public voxdag::TriangleStream {
 public:
  explicit VectorStream(std::vector<voxdag::FixedTriangle> triangles, size_t batch = 1000)
      : triangles_(std::move(triangles)), batch_(batch) {}
  uint64_t count() const override { return triangles_.size(); }
  void rewind() override { next_ = 0; }
  size_t read(std::span<voxdag::FixedTriangle> out) override {
    const size_t n = std::min({out.size(), batch_, triangles_.size() - next_});
    std::copy_n(triangles_.begin() + static_cast<std::ptrdiff_t>(next_), n, out.begin());
    next_ += n;
    return n;
  }

 private:
  std::vector<voxdag::FixedTriangle> triangles_;
  size_t batch_, next_ = 0;
};

}  // namespace oracle
