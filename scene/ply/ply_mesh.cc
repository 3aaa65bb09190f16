#include "scene/ply/ply_mesh.h"

#include <algorithm>
#include <cmath>

#include "scene/surface_numbers.h"

namespace voxdag::ply {

PlyMesh::PlyMesh(const PlyFile& ply, Surfaces& surfaces, unsigned cursors, MemoryBudget& budget)
    : ply_(ply), surfaces_(surfaces), budget_(budget), vertices_(ply, ply.layout().axes, budget) {
  if (ply.face_triangles() > 0) faces_.emplace(ply, cursors, budget);
  if (ply.triangles() > ply.face_triangles()) strips_.emplace(ply.open_strips(budget));
}

void PlyMesh::read_corners(uint64_t first, uint64_t count, uint32_t* corners) {
  const uint64_t all = ply_.face_triangles();
  face_triangles_ = first < all ? static_cast<size_t>(std::min(count, all - first)) : 0;
  if (face_triangles_ > 0) faces_->read(first, face_triangles_, corners, face_values_);
  if (face_triangles_ < count)
    read_strips(first + face_triangles_ - all, count - face_triangles_,
                corners + 3 * face_triangles_);
}

void PlyMesh::read_strips(uint64_t first, uint64_t count, uint32_t* corners) {
  if (first != next_strip_triangle_) {
    uint32_t skipped[3];
    next_strip_triangle_ = UINT64_MAX;
    strips_->seek(ply_.strip_blocks()[static_cast<size_t>(first / PlyFile::kBlockRows)]);
    for (uint64_t i = first % PlyFile::kBlockRows; i > 0; --i) strips_->next(skipped);
  }
  for (uint64_t i = 0; i < count; ++i) strips_->next(corners + 3 * i);
  next_strip_triangle_ = first + count;
}

std::string PlyMesh::place_of(uint64_t triangle) {
  const uint64_t all = ply_.face_triangles();
  if (triangle < all) return "face " + std::to_string(faces_->face_of(triangle));
  uint32_t corners[3];
  read_strips(triangle - all, 1, corners);
  return "tristrips " + std::to_string(strips_->row());
}

bool PlyMesh::open_surfaces(unsigned cursors) {
  const Layout& layout = ply_.layout();
  const uint64_t vertices = ply_.vertex_element().count;
  values_ = &surfaces_.values();
  if (!layout.vertex_colors.empty())
    colors_.emplace(
        Cached<Color>{VertexReader(ply_, layout.vertex_colors, budget_), std::vector<double>(),
                      BlockCache<Color>(budget_, vertices, cursors, "the colors of vertices")});
  if (!layout.vertex_texture.empty())
    texcoords_.emplace(Cached<Pair>{
        VertexReader(ply_, layout.vertex_texture, budget_), std::vector<double>(),
        BlockCache<Pair>(budget_, vertices, cursors, "texture coordinates of a scene")});
  const RequestedProperties of_faces = Surfaces::face_properties(layout);
  const bool has_face_values = !of_faces.numbers.empty() || of_faces.reals != Layout::kNone;
  if (faces_ && has_face_values) faces_->request(of_faces);
  return colors_ || texcoords_ || has_face_values;
}

void PlyMesh::read_surfaces(std::span<const uint32_t> numbers, const uint32_t* corners,
                            SurfaceTriangle* out) {
  for (const uint32_t number : numbers) {
    const uint32_t* const vertices = &corners[3 * size_t{number}];
    out->material = 0;
    out->corners = {};
    if (!read_texture(number, vertices, *out)) read_colors(number, vertices, *out);
    ++out;
  }
}

// Sets the material and the texture coordinates of a triangle. If the triangle has no usable
// texture, changes nothing and returns false.
bool PlyMesh::read_texture(size_t number, const uint32_t* vertices, SurfaceTriangle& out) {
  const size_t texture = texture_of(number);
  std::array<double, 6> texcoords;
  if (!Surfaces::is_usable(*values_, texture) || !find_texcoords(number, vertices, texcoords))
    return false;
  out.material = static_cast<uint32_t>(texture) + 1;
  // In PLY, v = 0 is the lower edge of the image.
  for (size_t k = 0; k < 3; ++k)
    out.corners[k].texture = {texture_lattice(texcoords[2 * k]),
                              texture_lattice(1 - texcoords[2 * k + 1])};
  return true;
}

size_t PlyMesh::texture_of(size_t number) const {
  if (number >= face_triangles_ || ply_.layout().texture_number == Layout::kNone) return 0;
  const size_t stride = face_values_.numbers.size() / face_triangles_;
  return Surfaces::texture_of(face_values_.numbers[stride * (number + 1) - 1]);
}

bool PlyMesh::find_texcoords(size_t number, const uint32_t* vertices, std::array<double, 6>& out) {
  if (number < face_triangles_ && ply_.layout().face_texture != Layout::kNone) {
    out = face_values_.texcoords[number];
    if (!std::isnan(out[0])) return true;
  }
  if (!texcoords_) return false;
  for (size_t k = 0; k < 3; ++k) std::ranges::copy(texcoords_of(vertices[k]), &out[2 * k]);
  return true;
}

void PlyMesh::read_colors(size_t number, const uint32_t* vertices, SurfaceTriangle& out) {
  const bool has_face_color = number < face_triangles_ && !ply_.layout().face_colors.empty();
  Color of_face;
  if (has_face_color) {
    const size_t stride = face_values_.numbers.size() / face_triangles_;
    of_face = values_->face_colors.to_color(&face_values_.numbers[stride * number]);
  }
  for (size_t k = 0; k < 3; ++k)
    if (colors_)
      out.corners[k].color = color_of(vertices[k]);
    else if (has_face_color)
      out.corners[k].color = of_face;
}

const Color& PlyMesh::color_of(uint32_t vertex) {
  return colors_->cache.at(vertex, [&](uint64_t first, size_t count, Color* out) {
    const size_t channels = values_->vertex_colors.channels();
    colors_->numbers.resize(channels * count);
    colors_->reader.read(first, count, colors_->numbers.data());
    for (size_t i = 0; i < count; ++i)
      out[i] = values_->vertex_colors.to_color(&colors_->numbers[channels * i]);
  });
}

const PlyMesh::Pair& PlyMesh::texcoords_of(uint32_t vertex) {
  return texcoords_->cache.at(vertex, [&](uint64_t first, size_t count, Pair* out) {
    texcoords_->numbers.resize(2 * count);
    texcoords_->reader.read(first, count, texcoords_->numbers.data());
    for (size_t i = 0; i < count; ++i)
      out[i] = {texcoords_->numbers[2 * i], texcoords_->numbers[2 * i + 1]};
  });
}

}  // namespace voxdag::ply
