// Streams the triangles of one document in world space: node by node, primitive by primitive,
// instance by instance. Vertices and indices stay in their windows while consecutive draws share
// them, so a mesh used by many nodes is read once.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/scene/gltf/batch.h"
#include "core/scene/gltf/geometry/corner_reader.h"
#include "core/scene/gltf/geometry/instance_reader.h"
#include "core/scene/gltf/geometry/node_walk.h"
#include "core/scene/gltf/geometry/vertex_cache.h"

namespace voxdag::gltf {

class TriangleStream {
 public:
  TriangleStream(const Document& document, BufferReader& buffers, MemoryBudget& budget,
                 bool skip_invalid, Batch& batch);

  // Gives every triangle to the batch, but for those it jumps over. Throws Error{kInvalidInput}
  // naming node, mesh and primitive for an invalid one, unless those are dropped.
  void run();

 private:
  // What the readers below are set up for.
  struct Binding {
    int mesh = -1;
    size_t primitive = 0;
    const double* weights = nullptr;
    int skin = -1;
    bool operator==(const Binding&) const = default;
  };

  void draw_node(const NodeWalk& at);
  void bind(const Node& node, size_t primitive_index);
  void draw_instance(const Transform& world, uint64_t first_triangle);
  void draw_window(const Transform& world, size_t count);
  bool place(const uint32_t* corners, const Transform& world, WorldTriangle& out);
  void report(const uint32_t* corners, const Transform& world) const;

  const Document& document_;
  BufferReader& buffers_;
  MemoryBudget& budget_;
  const bool skip_invalid_;
  Batch& batch_;

  Binding binding_;
  std::vector<Transform> joints_;
  std::optional<VertexSource> vertices_;
  std::optional<CornerReader> corner_reader_;
  VertexCache cache_;
  uint64_t vertex_count_ = 0;
  uint64_t triangle_count_ = 0;

  std::vector<uint32_t> corners_;  // of the window that begins at window_first_
  uint64_t window_first_ = 0;

  // For messages.
  int node_ = -1;
  uint64_t instance_ = 0;
};

}  // namespace voxdag::gltf
