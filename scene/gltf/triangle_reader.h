// Reads the triangles of one document in world space: node by node, primitive by primitive,
// instance by instance. The decoded data of a primitive is reused by the next node or instance that
// draws it. Not thread-safe.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/base/page_buffer.h"
#include "core/geometry/grid.h"
#include "scene/gltf/materials/surface_reader.h"
#include "scene/gltf/mesh_data/corner_reader.h"
#include "scene/gltf/mesh_data/instance_reader.h"
#include "scene/gltf/mesh_data/node_walk.h"
#include "scene/gltf/mesh_data/vertex_source.h"
#include "scene/vertices/used_vertices.h"
#include "scene/vertices/vertex_cache.h"
#include "voxdag/cancel_token.h"

namespace voxdag::gltf {

struct ReaderOptions {
  bool skip_invalid = false;  // drops invalid triangles
  unsigned readers = 1;       // number of readers that share the memory
};

class TriangleReader {
 public:
  using Visitor = std::function<void(std::span<const RealTriangle>)>;
  using SurfaceVisitor = std::function<void(std::span<const SurfaceTriangle>)>;

  TriangleReader(const Document& document, BufferReader& buffers, const ReaderOptions& options,
                 MemoryBudget& budget, const CancelToken& cancel);

  // Passes triangles [first, first + count) of the document's order to `visit`, in batches of up to
  // 1024. They are in world space, or snapped to `grid` if it is not null. Omits invalid triangles
  // if `skip_invalid` is set. Otherwise throws Error{kInvalidInput} for the first invalid triangle,
  // with its node, mesh and primitive.
  void read(uint64_t first, uint64_t count, const Grid* grid, const Visitor& visit);
  // Passes triangles [first, first + count) in world space, with their surfaces, to `visit`, in
  // batches of up to 1024.
  void read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit);
  // Returns the bounds of triangles [first, first + count) in world space.
  WorldBounds read_bounds(uint64_t first, uint64_t count);

 private:
  static constexpr size_t kBatchTriangles = 1024;
  static constexpr uint64_t kWindowTriangles = 4096;

  // A primitive that a node draws, with all instances of the node.
  struct Draw {
    uint64_t first = 0, end = 0;  // the triangles [first, end) of the document
    int node = -1;
    size_t primitive = 0;
    uint64_t triangles = 0;  // triangles per instance
    bool is_bound = false;
  };
  // The mesh, primitive, morph weights and skin for which vertices_, corner_reader_ and
  // surface_reader_ are set up.
  struct Binding {
    int mesh = -1;
    size_t primitive = 0;
    const double* weights = nullptr;
    int skin = -1;
    bool operator==(const Binding&) const = default;
  };

  template <class Body>
  void for_each_instance(uint64_t first, uint64_t count, const Grid* grid, const Body& body);
  void seek(uint64_t triangle);
  void next_draw();
  void bind_draw();
  void bind(const Node& node, size_t primitive_index);
  template <class Body>
  void for_each_window(uint64_t first, uint64_t count, const Body& body);
  bool add_bounds_of_window(WorldBounds& bounds);
  const uint32_t* load_corners(uint64_t first, uint64_t count);
  void place_all(const uint32_t* corners, uint64_t count);
  void place_all_surfaces(const uint32_t* corners, uint64_t count);
  bool place(const uint32_t* corners, RealTriangle& out);
  void flush();
  void report(const uint32_t* corners) const;

  const Document& document_;
  BufferReader& buffers_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const bool skip_invalid_;
  const unsigned readers_;

  std::optional<NodeWalk> walk_;
  Draw draw_;
  std::optional<InstanceReader> instances_;  // instances of the draw
  uint64_t instance_ = 0;
  Transform world_;  // world transform of the instance

  Binding binding_;
  PageBuffer<Transform> joints_;  // matrices of the skin in binding_; empty without one
  std::optional<VertexSource> vertices_;
  std::optional<CornerReader> corner_reader_;
  VertexCache cache_;
  uint64_t vertex_count_ = 0;

  // Vertex indices of window_count_ triangles, starting at window_first_.
  std::vector<uint32_t> corners_;
  uint64_t window_first_ = 0, window_count_ = 0;
  UsedVertices used_vertices_;  // vertices of the window's triangles; empty until collected

  PageBuffer<RealTriangle> batch_;
  size_t batch_size_ = 0;
  const Visitor* visit_ = nullptr;

  std::optional<SurfaceReader> surface_reader_;  // set by the first read_surfaces()
  PageBuffer<SurfaceTriangle> surfaces_;         // one batch of surfaces
};

}  // namespace voxdag::gltf
