// Streams the triangles of one document in world space: node by node, primitive by primitive,
// instance by instance. Vertices and indices stay in their windows while consecutive nodes or
// instances draw the same primitive, so a mesh used by many nodes is read once. Not thread-safe.
#pragma once

#include <optional>
#include <vector>

#include "core/base/page_buffer.h"
#include "core/scene/gltf/batch.h"
#include "core/scene/gltf/geometry/corner_reader.h"
#include "core/scene/gltf/geometry/instance_reader.h"
#include "core/scene/gltf/geometry/node_walk.h"
#include "core/scene/gltf/geometry/vertex_cache.h"

namespace voxdag::gltf {

class TriangleReader {
 public:
  TriangleReader(const Document& document, BufferReader& buffers, MemoryBudget& budget,
                 bool skip_invalid, Batch& batch);

  // Adds every triangle to the batch, except those that the batch skips. Throws
  // Error{kInvalidInput} naming node, mesh and primitive of an invalid triangle, unless
  // `skip_invalid` drops it.
  void run();

 private:
  // What the readers are set up for.
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
  PageBuffer<Transform> joints_;  // of the skin in binding_; empty without one
  std::optional<VertexSource> vertices_;
  std::optional<CornerReader> corner_reader_;
  VertexCache cache_;
  uint64_t vertex_count_ = 0;
  uint64_t triangle_count_ = 0;

  std::vector<uint32_t> corners_;  // vertex indices from triangle window_first_ on
  uint64_t window_first_ = 0;

  int node_ = -1;          // being drawn, for messages
  uint64_t instance_ = 0;  // being drawn, for messages
};

}  // namespace voxdag::gltf
