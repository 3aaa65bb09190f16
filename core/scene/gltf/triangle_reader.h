// Streams the triangles of one document in world space: node by node, primitive by primitive,
// instance by instance. Vertices and indices stay in their windows while consecutive nodes or
// instances draw the same primitive, so a mesh used by many nodes is read once. Not thread-safe.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/page_buffer.h"
#include "core/geometry/grid.h"
#include "core/scene/gltf/mesh_data/corner_reader.h"
#include "core/scene/gltf/mesh_data/instance_reader.h"
#include "core/scene/gltf/mesh_data/node_walk.h"
#include "core/scene/gltf/mesh_data/vertex_cache.h"

namespace voxdag::gltf {

// How far a pass over the triangles has come.
struct PassPosition {
  uint64_t triangles = 0;  // skipped and invalid ones included
  uint64_t invalid = 0;    // skipped ones not included
};

// Collects triangles into batches for the visitor of a pass, and counts them. Not thread-safe.
class Batch {
 public:
  using Visitor = std::function<void(std::span<const WorldTriangle>)>;
  static constexpr size_t kTriangles = 4096;

  // Counts in `position`. The first `skip_count` triangles of the pass are skipped.
  Batch(const Visitor& visit, PassPosition& position, uint64_t skip_count, MemoryBudget& budget,
        const CancelToken& cancel)
      : visit_(visit),
        position_(position),
        left_to_skip_(skip_count),
        cancel_(cancel),
        triangles_(budget, kTriangles, "a batch of triangles") {}

  // Skips the first of the next `count` triangles, as far as the pass requires, and returns how
  // many.
  uint64_t skip(uint64_t count) {
    const uint64_t skipped = std::min(count, left_to_skip_);
    left_to_skip_ -= skipped;
    position_.triangles += skipped;
    return skipped;
  }
  // The place of the next triangle, to be followed by add() or drop().
  WorldTriangle& next() { return triangles_[size_]; }
  // Adds the triangle in next() to the batch.
  void add() {
    ++position_.triangles;
    if (++size_ == kTriangles) flush();
  }
  // Counts an invalid triangle.
  void drop() {
    ++position_.triangles;
    ++position_.invalid;
  }
  // Passes the triangles of an incomplete batch on. Call at the end of the pass.
  void flush() {
    cancel_.check();
    if (size_ > 0) visit_(std::span<const WorldTriangle>(triangles_.data(), size_));
    size_ = 0;
  }
  void check_canceled() const { cancel_.check(); }

 private:
  const Visitor& visit_;
  PassPosition& position_;
  uint64_t left_to_skip_;
  const CancelToken& cancel_;
  PageBuffer<WorldTriangle> triangles_;
  size_t size_ = 0;
};

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
