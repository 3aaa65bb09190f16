#include "query/export/surface/surface_mesh.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace voxdag::query {
namespace {

using voxdag_reader::Rgb;

constexpr size_t kMinSlots = 64;

// Returns the number of slots for this number of vertices: at most 3/4 of the slots are used.
size_t slots_for_vertices(uint64_t vertices) {
  return std::bit_ceil(std::max<size_t>(kMinSlots, vertices / 3 * 4 + 4));
}
// Returns a low estimate of the number of vertices. Typical scenes have 4/3 vertices per rectangle.
uint64_t expected_vertices(const Surface& surface) { return surface.rectangles().size() / 4 * 3; }

// Returns the position of a point of a rectangle.
uint64_t place_on(const SurfaceRectangle& rectangle, uint32_t u, uint32_t v) {
  std::array<uint32_t, 3> at{};
  at[rectangle.axis] = rectangle.plane;
  at[(rectangle.axis + 1u) % 3] = u;
  at[(rectangle.axis + 2u) % 3] = v;
  return PackedPlace::pack(at);
}

// Returns the corners of a rectangle, counterclockwise as seen from outside.
std::array<uint64_t, 4> corners_of(const SurfaceRectangle& r) {
  const std::array<uint64_t, 4> corners = {place_on(r, r.u0, r.v0), place_on(r, r.u1, r.v0),
                                           place_on(r, r.u1, r.v1), place_on(r, r.u0, r.v1)};
  if (r.upward) return corners;
  return {corners[3], corners[2], corners[1], corners[0]};
}

}  // namespace

VertexTable::VertexTable(MemoryBudget& budget, uint64_t expected)
    : budget_(budget),
      slots_(budget, slots_for_vertices(expected), surface_memory()),
      shift_(64 - std::countr_zero(slots_.size())),
      places_(budget, surface_memory()),
      colors_(budget, surface_memory()) {}

// Returns the slot of a vertex, or the free slot where it belongs.
size_t VertexTable::probe(uint64_t place, uint32_t color) const {
  size_t at = slot_of(place, color);
  while (slots_[at].vertex_plus_1 != 0 && (slots_[at].place != place || slots_[at].color != color))
    at = (at + 1) & (slots_.size() - 1);
  return at;
}

void VertexTable::grow() {
  PageBuffer<Slot> old =
      std::exchange(slots_, PageBuffer<Slot>(budget_, 2 * slots_.size(), surface_memory()));
  --shift_;
  for (const Slot& slot : old)
    if (slot.vertex_plus_1 != 0) slots_[probe(slot.place, slot.color)] = slot;
}

uint32_t VertexTable::find_or_add(uint64_t place, Rgb color) {
  const uint32_t code = color_code(color);
  size_t at = probe(place, code);
  if (slots_[at].vertex_plus_1 != 0) return slots_[at].vertex_plus_1 - 1;
  if (places_.size() + 1 > slots_.size() / 4 * 3) {
    grow();
    at = probe(place, code);
  }
  places_.push_back(place);
  colors_.push_back(color);
  slots_[at] = {place, code, static_cast<uint32_t>(places_.size())};
  return static_cast<uint32_t>(places_.size() - 1);
}

bool VertexTable::contains(uint64_t place, Rgb color) const {
  return slots_[probe(place, color_code(color))].vertex_plus_1 != 0;
}

SurfaceMesh::SurfaceMesh(const ExportJob& job, const Surface& surface)
    : vertices_(job.budget, expected_vertices(surface)), indices_(job.budget, surface_memory()) {
  const bool closed = job.options.watertight;
  ExportStage stage(job, "find vertices", (closed ? 2 : 1) * surface.rectangles().size(),
                    "rectangles");
  closed ? add_closed(surface, stage) : add_rectangles(surface, stage);
}

void SurfaceMesh::add_triangle(uint32_t a, uint32_t b, uint32_t c, bool upward) {
  indices_.push_back(a);
  indices_.push_back(upward ? b : c);
  indices_.push_back(upward ? c : b);
}

// Adds two triangles for each rectangle.
void SurfaceMesh::add_rectangles(const Surface& surface, ExportStage& stage) {
  // The distance, in rectangles, at which the slots of the vertices are prefetched.
  constexpr size_t kAhead = 8;
  const GrowingBuffer<SurfaceRectangle>& all = surface.rectangles();
  for (size_t i = 0; i < all.size(); ++i) {
    if (i + kAhead < all.size())
      for (const uint64_t place : corners_of(all[i + kAhead]))
        vertices_.prefetch(place, all[i + kAhead].color);
    std::array<uint32_t, 4> corner{};
    const std::array<uint64_t, 4> places = corners_of(all[i]);
    for (size_t c = 0; c < 4; ++c) corner[c] = vertices_.find_or_add(places[c], all[i].color);
    add_triangle(corner[0], corner[1], corner[2], true);
    add_triangle(corner[0], corner[2], corner[3], true);
    stage.advance(1);
  }
}

void SurfaceMesh::add_closed(const Surface& surface, ExportStage& stage) {
  VertexTable corners(vertices_.budget(), expected_vertices(surface));
  for (const SurfaceRectangle& rectangle : surface.rectangles()) {
    for (const uint64_t place : corners_of(rectangle)) corners.find_or_add(place, {});
    stage.advance(1);
  }
  for (const SurfaceRectangle& rectangle : surface.rectangles()) {
    add_closed_rectangle(rectangle, corners);
    stage.advance(1);
  }
}

void SurfaceMesh::add_closed_rectangle(const SurfaceRectangle& r, const VertexTable& corners) {
  for (size_t side = 0; side < 4; ++side) {
    const bool along_u = side < 2;
    const uint32_t begin = along_u ? r.u0 : r.v0, end = along_u ? r.u1 : r.v1;
    const uint32_t fixed = side == 0 ? r.v0 : side == 1 ? r.v1 : side == 2 ? r.u0 : r.u1;
    sides_[side].clear();
    for (uint32_t at = begin; at <= end; ++at) {
      const uint64_t place = along_u ? place_on(r, at, fixed) : place_on(r, fixed, at);
      if (at == begin || at == end || corners.contains(place, {}))
        sides_[side].push_back({at, vertices_.find_or_add(place, r.color)});
    }
  }
  add_strip(r.upward);
}

// Adds the triangles of the current rectangle. They form a strip from side u0 to side u1, between
// the points of the sides v0 and v1. The complete side u0 is an edge of the first triangle, and the
// complete side u1 is an edge of the last one. So these two triangles are divided further, at the
// points of these sides.
void SurfaceMesh::add_strip(bool upward) {
  const auto& [low, high, first, last] = sides_;
  const size_t steps = low.size() + high.size() - 2;
  size_t i = 0, j = 0;
  for (size_t step = 0; step < steps; ++step) {
    const bool advances_low =
        j + 1 == high.size() || (i + 1 < low.size() && low[i + 1].at <= high[j + 1].at);
    const uint32_t apex = advances_low ? low[i + 1].vertex : high[j + 1].vertex;
    const uint32_t opposite = advances_low ? low[i].vertex : high[j].vertex;
    if (step == 0)
      for (size_t k = 0; k + 1 < first.size(); ++k)
        add_triangle(first[k].vertex, apex, first[k + 1].vertex, upward);
    else if (step + 1 == steps)
      for (size_t k = 0; k + 1 < last.size(); ++k)
        add_triangle(opposite, last[k].vertex, last[k + 1].vertex, upward);
    else
      add_triangle(low[i].vertex, apex, high[j].vertex, upward);
    advances_low ? ++i : ++j;
  }
}

}  // namespace voxdag::query
