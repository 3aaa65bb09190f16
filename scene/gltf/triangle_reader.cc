#include "scene/gltf/triangle_reader.h"

#include <algorithm>
#include <cmath>

#include "core/base/error.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

uint64_t largest_vertex_count(const Document& document) {
  uint64_t largest = 0;
  for (const Mesh& mesh : document.meshes)
    for (const Primitive& primitive : mesh.primitives)
      if (mesh.is_drawn && primitive.makes_triangles())
        largest =
            std::max(largest, document.accessors[static_cast<size_t>(primitive.position)].count);
  return largest;
}

// If a vertex is not finite, all its coordinates are NaN. So only the first coordinate of each
// vertex is tested.
bool is_finite(const RealTriangle& triangle) {
  return !std::isnan(triangle.v[0][0]) && !std::isnan(triangle.v[1][0]) &&
         !std::isnan(triangle.v[2][0]);
}

}  // namespace

TriangleReader::TriangleReader(const Document& document, BufferReader& buffers,
                               const ReaderOptions& options, MemoryBudget& budget,
                               const CancelToken& cancel)
    : document_(document),
      buffers_(buffers),
      budget_(budget),
      cancel_(cancel),
      skip_invalid_(options.skip_invalid),
      readers_(options.readers),
      cache_(budget, largest_vertex_count(document), options.readers),
      corners_(3 * kWindowTriangles),
      batch_(budget, kBatchTriangles, "a batch of triangles") {}

void TriangleReader::read(uint64_t first, uint64_t count, const Grid* grid, const Visitor& visit) {
  visit_ = &visit;
  batch_size_ = 0;
  for_each_instance(first, count, grid, [&](uint64_t of_instance, uint64_t n) {
    for_each_window(of_instance, n,
                    [&](const uint32_t* corners, uint64_t size) { place_all(corners, size); });
  });
  flush();
}

void TriangleReader::read_surfaces(uint64_t first, uint64_t count, const SurfaceVisitor& visit) {
  if (!surface_reader_) {
    surfaces_ = PageBuffer<SurfaceTriangle>(budget_, kBatchTriangles, "a batch of triangles");
    surface_reader_.emplace(document_, buffers_, largest_vertex_count(document_), readers_);
    draw_.is_bound = false;
    binding_ = {};
  }
  batch_size_ = 0;
  const auto flush_surfaces = [&] {
    cancel_.check();
    if (batch_size_ > 0) visit({surfaces_.data(), batch_size_});
    batch_size_ = 0;
  };
  for_each_instance(first, count, nullptr, [&](uint64_t of_instance, uint64_t n) {
    for_each_window(of_instance, n, [&](const uint32_t* corners, uint64_t size) {
      while (size > 0) {
        const uint64_t part = std::min<uint64_t>(size, kBatchTriangles - batch_size_);
        place_all_surfaces(corners, part);
        if (batch_size_ == kBatchTriangles) flush_surfaces();
        corners += 3 * part;
        size -= part;
      }
    });
  });
  flush_surfaces();
}

WorldBounds TriangleReader::read_bounds(uint64_t first, uint64_t count) {
  WorldBounds bounds;
  const Visitor add_batch = [&](std::span<const WorldTriangle> batch) {
    bounds.add(bounds_of(batch));
  };
  visit_ = &add_batch;
  batch_size_ = 0;
  for_each_instance(first, count, nullptr, [&](uint64_t of_instance, uint64_t n) {
    for_each_window(of_instance, n, [&](const uint32_t* corners, uint64_t size) {
      cancel_.check();
      if (size < window_count_ || !add_bounds_of_window(bounds)) place_all(corners, size);
    });
  });
  flush();
  return bounds;
}

// Divides triangles [first, first + count) into ranges of one instance each. For each range, sets
// world_ to the instance's transform, then calls body(first triangle within the instance, number of
// triangles).
template <class Body>
void TriangleReader::for_each_instance(uint64_t first, uint64_t count, const Grid* grid,
                                       const Body& body) {
  for (const uint64_t end = first + count; first < end;) {
    seek(first);
    if (!draw_.is_bound) bind_draw();
    cancel_.check();
    const uint64_t of_draw = first - draw_.first;
    const uint64_t of_instance = of_draw % draw_.triangles;
    const uint64_t n = std::min(end - first, draw_.triangles - of_instance);
    instance_ = of_draw / draw_.triangles;
    // A skin's joint matrices already move the vertices to world space.
    world_ = binding_.skin >= 0 ? Transform{} : walk_->global();
    const Node& node = document_.nodes[static_cast<size_t>(draw_.node)];
    if (node.instancing.present) world_ = multiply(world_, instances_->at(instance_));
    cache_.place(world_, grid);
    body(of_instance, n);
    first += n;
  }
}

// Sets draw_ to the draw that contains this triangle.
void TriangleReader::seek(uint64_t triangle) {
  if (!walk_ || triangle < draw_.first) {
    walk_.emplace(document_, budget_);
    draw_ = {};
  }
  while (triangle >= draw_.end) next_draw();
}

void TriangleReader::next_draw() {
  Draw next{.first = draw_.end, .node = draw_.node, .primitive = draw_.primitive + 1};
  const auto primitives = [&]() -> const std::vector<Primitive>& {
    const Node& node = document_.nodes[static_cast<size_t>(next.node)];
    return document_.meshes[static_cast<size_t>(node.mesh)].primitives;
  };
  if (next.node < 0 || next.primitive == primitives().size()) {
    do {
      if (!walk_->next())
        throw Error(ErrorCode::kCorrupt,
                    document_.path + ": triangle " + std::to_string(draw_.end) +
                        " does not exist, although the counts of the accessors include it");
      next.node = walk_->node();
    } while (primitives().empty());
    next.primitive = 0;
  }
  next.triangles = triangle_count(document_, primitives()[next.primitive]);
  next.end =
      next.first +
      next.triangles * instance_count(document_, document_.nodes[static_cast<size_t>(next.node)]);
  draw_ = next;
}

void TriangleReader::bind_draw() {
  const Node& node = document_.nodes[static_cast<size_t>(draw_.node)];
  bind(node, draw_.primitive);
  instances_.emplace(document_, buffers_, node);
  draw_.is_bound = true;
}

void TriangleReader::bind(const Node& node, size_t primitive_index) {
  const Mesh& mesh = document_.meshes[static_cast<size_t>(node.mesh)];
  const std::vector<double>& weights = node.weights.empty() ? mesh.weights : node.weights;
  const Primitive& primitive = mesh.primitives[primitive_index];
  const int skin = primitive.joint_sets.empty() ? -1 : node.skin;
  const Binding next{node.mesh, primitive_index, weights.data(), skin};
  if (next == binding_) return;
  if (skin != binding_.skin) {
    binding_ = {};
    joints_ = {};
    if (skin >= 0) joints_ = joint_matrices(document_, buffers_, skin);
  }
  binding_ = {};
  vertices_.emplace(document_, buffers_, primitive, weights,
                    std::span<const Transform>(joints_.data(), joints_.size()));
  corner_reader_.emplace(document_, buffers_, primitive);
  cache_.bind(*vertices_);
  vertex_count_ = vertices_->count();
  window_count_ = 0;
  if (surface_reader_) surface_reader_->bind(primitive);
  binding_ = next;
}

// Divides triangles [first, first + count) of an instance into parts that fit in the window. Calls
// body(vertex indices, number of triangles) for each part.
template <class Body>
void TriangleReader::for_each_window(uint64_t first, uint64_t count, const Body& body) {
  while (count > 0) {
    const uint32_t* const corners = load_corners(first, count);
    const uint64_t n = std::min(count, window_first_ + window_count_ - first);
    body(corners, n);
    first += n;
    count -= n;
  }
}

// Returns the vertex indices of triangle `first` and of the following triangles in the window. If
// `first` is not in the window, loads at most `count` triangles from there, or the complete
// primitive if it fits in the window.
const uint32_t* TriangleReader::load_corners(uint64_t first, uint64_t count) {
  if (first < window_first_ || first >= window_first_ + window_count_) {
    window_count_ = 0;
    used_vertices_.clear();
    const bool fits = draw_.triangles <= kWindowTriangles;
    const uint64_t from = fits ? 0 : first;
    const uint64_t n = fits ? draw_.triangles : std::min(count, kWindowTriangles);
    corner_reader_->read(from, static_cast<size_t>(n), corners_.data());
    window_first_ = from;
    window_count_ = n;
  }
  return &corners_[3 * static_cast<size_t>(first - window_first_)];
}

// Adds the positions of the window's triangles to `bounds`. If a triangle of the window is invalid,
// returns false and leaves `bounds` unchanged.
bool TriangleReader::add_bounds_of_window(WorldBounds& bounds) {
  if (used_vertices_.is_empty())
    used_vertices_.find({corners_.data(), 3 * static_cast<size_t>(window_count_)});
  return used_vertices_.add_to(bounds, cache_, vertex_count_);
}

void TriangleReader::place_all(const uint32_t* corners, uint64_t count) {
  for (; count > 0; --count, corners += 3) {
    if (!place(corners, batch_[batch_size_])) {
      if (!skip_invalid_) report(corners);
    } else if (++batch_size_ == kBatchTriangles) {
      flush();
    }
  }
}

// Adds the surfaces of `count` triangles to the batch, which must have space for them.
void TriangleReader::place_all_surfaces(const uint32_t* corners, uint64_t count) {
  const bool is_mirrored = mirrors(world_);
  const Primitive& primitive =
      document_.meshes[static_cast<size_t>(binding_.mesh)].primitives[binding_.primitive];
  const bool is_strip = primitive.mode == kTriangleStrip && !primitive.restarts;
  for (; count > 0; --count, corners += 3) {
    SurfaceTriangle& surface = surfaces_[batch_size_];
    if (place(corners, surface.position)) {
      surface_reader_->read(corners, surface);
      const uint64_t number = window_first_ + static_cast<uint64_t>(corners - corners_.data()) / 3;
      surface.is_flipped = is_mirrored != (is_strip && number % 2 == 1);
      ++batch_size_;
    } else if (!skip_invalid_) {
      report(corners);
    }
  }
}

void TriangleReader::flush() {
  cancel_.check();
  if (batch_size_ > 0) (*visit_)({batch_.data(), batch_size_});
  batch_size_ = 0;
}

// Sets `out` to the triangle with these vertex indices. Returns false if an index is out of range
// or a vertex is not finite in world space.
bool TriangleReader::place(const uint32_t* corners, RealTriangle& out) {
  if (std::max({corners[0], corners[1], corners[2]}) >= vertex_count_) return false;
  for (int k = 0; k < 3; ++k) std::copy_n(cache_.at(corners[k]), 3, out.v[k]);
  return cache_.all_finite() || is_finite(out);
}

void TriangleReader::report(const uint32_t* corners) const {
  const Node& node = document_.nodes[static_cast<size_t>(draw_.node)];
  const Primitive& primitive =
      document_.meshes[static_cast<size_t>(binding_.mesh)].primitives[binding_.primitive];
  std::string where = document_.name_node(draw_.node);
  if (node.instancing.present) where += ": instance " + std::to_string(instance_);
  where += ": " + document_.name_mesh(binding_.mesh) + ": primitive " +
           std::to_string(binding_.primitive) + ": triangle " +
           std::to_string(window_first_ + static_cast<uint64_t>(corners - corners_.data()) / 3) +
           ": ";
  for (int k = 0; k < 3; ++k)
    if (corners[k] >= vertex_count_)
      refuse(document_.path, where + "index " + std::to_string(corners[k]) + " of " +
                                 document_.name_accessor(primitive.indices) +
                                 " does not exist, there are " + std::to_string(vertex_count_) +
                                 " vertices");
  refuse(document_.path, where + "a vertex of " + document_.name_accessor(primitive.position) +
                             (voxdag::is_finite(world_) ? "" : " with the node's transform") +
                             not_finite());
}

}  // namespace voxdag::gltf
