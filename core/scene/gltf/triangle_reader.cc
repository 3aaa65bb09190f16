#include "core/scene/gltf/triangle_reader.h"

#include <algorithm>

#include "core/scene/gltf/messages.h"

namespace voxdag::gltf {
namespace {

constexpr uint64_t kNoWindow = ~uint64_t{0};

uint64_t largest_vertex_count(const Document& document) {
  uint64_t largest = 0;
  for (const Mesh& mesh : document.meshes)
    for (const Primitive& primitive : mesh.primitives)
      if (primitive.makes_triangles())
        largest =
            std::max(largest, document.accessors[static_cast<size_t>(primitive.position)].count);
  return largest;
}

bool is_finite(const double* point) {
  return (point[0] - point[0]) + (point[1] - point[1]) + (point[2] - point[2]) == 0;
}

}  // namespace

TriangleReader::TriangleReader(const Document& document, BufferReader& buffers,
                               MemoryBudget& budget, bool skip_invalid, Batch& batch)
    : document_(document),
      buffers_(buffers),
      budget_(budget),
      skip_invalid_(skip_invalid),
      batch_(batch),
      cache_(budget, largest_vertex_count(document)),
      corners_(3 * Batch::kTriangles) {}

void TriangleReader::run() {
  NodeWalk walk(document_, budget_);
  while (walk.next()) draw_node(walk);
}

void TriangleReader::draw_node(const NodeWalk& walk) {
  node_ = walk.node();
  const Node& node = document_.nodes[static_cast<size_t>(node_)];
  const Mesh& mesh = document_.meshes[static_cast<size_t>(node.mesh)];
  // The joints of a skin place its vertices in world space already.
  const Transform global = node.skin >= 0 ? Transform{} : walk.global();
  for (size_t p = 0; p < mesh.primitives.size(); ++p) {
    const uint64_t triangles = triangle_count(document_, mesh.primitives[p]);
    const uint64_t all = triangles * instance_count(document_, node);
    const uint64_t skipped = batch_.skip(all);
    if (skipped == all) continue;
    bind(node, p);
    InstanceReader instances(document_, buffers_, node);
    uint64_t first = skipped % triangles;
    for (instance_ = skipped / triangles; instance_ < instances.count(); ++instance_, first = 0)
      draw_instance(node.instancing.present ? multiply(global, instances.at(instance_)) : global,
                    first);
  }
}

void TriangleReader::bind(const Node& node, size_t primitive_index) {
  const Mesh& mesh = document_.meshes[static_cast<size_t>(node.mesh)];
  const std::vector<double>& weights = node.weights.empty() ? mesh.weights : node.weights;
  const Binding next{node.mesh, primitive_index, weights.data(), node.skin};
  if (next == binding_) return;
  const Primitive& primitive = mesh.primitives[primitive_index];
  if (node.skin != binding_.skin) {
    binding_ = {};
    joints_ = {};
    if (node.skin >= 0) joints_ = joint_matrices(document_, buffers_, node.skin);
  }
  binding_ = {};
  vertices_.emplace(document_, buffers_, primitive, weights,
                    std::span<const Transform>(joints_.data(), joints_.size()));
  corner_reader_.emplace(document_, buffers_, primitive);
  cache_.bind(*vertices_);
  vertex_count_ = vertices_->count();
  triangle_count_ = triangle_count(document_, primitive);
  window_first_ = kNoWindow;
  binding_ = next;
}

void TriangleReader::draw_instance(const Transform& world, uint64_t first_triangle) {
  batch_.check_canceled();
  for (uint64_t first = first_triangle; first < triangle_count_; first += Batch::kTriangles) {
    const auto count =
        static_cast<size_t>(std::min<uint64_t>(Batch::kTriangles, triangle_count_ - first));
    if (first != window_first_) {
      window_first_ = kNoWindow;
      corner_reader_->read(first, count, corners_.data());
      window_first_ = first;
    }
    draw_window(world, count);
  }
}

void TriangleReader::draw_window(const Transform& world, size_t count) {
  const uint32_t* corners = corners_.data();
  for (size_t i = 0; i < count; ++i, corners += 3) {
    if (place(corners, world, batch_.next())) {
      batch_.add();
    } else {
      if (!skip_invalid_) report(corners, world);
      batch_.drop();
    }
  }
}

// False for a corner out of range or a vertex that is not finite in world space.
bool TriangleReader::place(const uint32_t* corners, const Transform& world, WorldTriangle& out) {
  if (std::max({corners[0], corners[1], corners[2]}) >= vertex_count_) return false;
  for (int k = 0; k < 3; ++k) apply(world, cache_.at(corners[k]), out.v[k]);
  return is_finite(out.v[0]) && is_finite(out.v[1]) && is_finite(out.v[2]);
}

void TriangleReader::report(const uint32_t* corners, const Transform& world) const {
  const Node& node = document_.nodes[static_cast<size_t>(node_)];
  const Primitive& primitive =
      document_.meshes[static_cast<size_t>(binding_.mesh)].primitives[binding_.primitive];
  std::string where = document_.name_node(node_);
  if (node.instancing.present) where += ": instance " + std::to_string(instance_);
  where += ": " + document_.name_mesh(binding_.mesh) + ": primitive " +
           std::to_string(binding_.primitive) + ": triangle " +
           std::to_string(window_first_ + static_cast<uint64_t>(corners - corners_.data()) / 3) +
           ": ";
  for (int k = 0; k < 3; ++k)
    if (corners[k] >= vertex_count_)
      refuse(document_.path, where + "index " + std::to_string(corners[k]) + " of " +
                                 document_.name_accessor(primitive.indices) + ", there are " +
                                 std::to_string(vertex_count_) + " vertices");
  refuse(document_.path, where + "a vertex of " + document_.name_accessor(primitive.position) +
                             (gltf::is_finite(world) ? " is not a finite position"
                                                     : " is not finite once transformed"));
}

}  // namespace voxdag::gltf
