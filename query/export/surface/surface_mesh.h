// The triangles of a surface (surface.h). Triangles share their vertices: two vertices with the
// same position and color are the same vertex.
//
// A closed mesh (`--watertight`) has no T-junctions: a rectangle has a vertex at each corner of
// other rectangles on its border. So each edge belongs to two triangles, or to four triangles where
// two voxels have only an edge in common.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "query/export/faces/growing_buffer.h"
#include "query/export/surface/surface.h"

namespace voxdag::query {

// A vertex position in cells, packed into one number.
struct PackedPlace {
  static constexpr int kBits = 21;
  static uint64_t pack(const std::array<uint32_t, 3>& at) {
    return (uint64_t{at[0]} << kBits | at[1]) << kBits | at[2];
  }
  static std::array<uint32_t, 3> unpack(uint64_t place) {
    constexpr uint64_t kMask = (uint64_t{1} << kBits) - 1;
    return {static_cast<uint32_t>(place >> 2 * kBits),
            static_cast<uint32_t>(place >> kBits & kMask), static_cast<uint32_t>(place & kMask)};
  }
};

// The vertices of a mesh, numbered in the order in which they were added. Finds a vertex by its
// position and color.
class VertexTable {
 public:
  // `expected` is an estimate of the number of vertices.
  VertexTable(MemoryBudget& budget, uint64_t expected);
  // Returns the number of the vertex. Adds the vertex if it is new. Throws Error{kOutOfMemory}.
  uint32_t find_or_add(uint64_t place, voxdag_reader::Rgb color);
  bool contains(uint64_t place, voxdag_reader::Rgb color) const;
  VOXDAG_PREFETCH void prefetch(uint64_t place, voxdag_reader::Rgb color) const {
    __builtin_prefetch(&slots_[slot_of(place, color_code(color))]);
  }
  MemoryBudget& budget() const { return budget_; }
  uint32_t size() const { return static_cast<uint32_t>(places_.size()); }
  uint64_t place(uint32_t vertex) const { return places_[vertex]; }
  voxdag_reader::Rgb color(uint32_t vertex) const { return colors_[vertex]; }

 private:
  struct Slot {
    uint64_t place = 0;
    uint32_t color = 0;
    uint32_t vertex_plus_1 = 0;  // 0: free
  };
  static uint32_t color_code(voxdag_reader::Rgb color) {
    return uint32_t{color.r} << 16 | uint32_t{color.g} << 8 | color.b;
  }
  size_t slot_of(uint64_t place, uint32_t color) const {
    return (place ^ uint64_t{color} << 40) * 0x9e3779b97f4a7c15u >> shift_;
  }
  size_t probe(uint64_t place, uint32_t color) const;
  void grow();

  MemoryBudget& budget_;
  PageBuffer<Slot> slots_;
  int shift_ = 64;
  GrowingBuffer<uint64_t> places_;
  GrowingBuffer<voxdag_reader::Rgb> colors_;
};

class SurfaceMesh {
 public:
  SurfaceMesh(const ExportJob& job, const Surface& surface);

  const VertexTable& vertices() const { return vertices_; }
  // The vertices of the triangles, counterclockwise as seen from outside.
  const GrowingBuffer<uint32_t>& indices() const { return indices_; }

 private:
  void add_rectangles(const Surface& surface, ExportStage& stage);
  void add_closed(const Surface& surface, ExportStage& stage);
  void add_corners(const Surface& surface, VertexTable& corners, ExportStage& stage);
  void add_closed_rectangle(const SurfaceRectangle& rectangle, const VertexTable& corners);
  void add_strip(bool upward);
  void add_triangle(uint32_t a, uint32_t b, uint32_t c, bool upward);

  VertexTable vertices_;
  GrowingBuffer<uint32_t> indices_;

  // A vertex on a side of a rectangle, and the vertex's coordinate along this side.
  struct SidePoint {
    uint32_t at, vertex;
  };
  // The sides v0, v1, u0 and u1 of the current rectangle, with both corners of each side.
  std::array<std::vector<SidePoint>, 4> sides_;
};

}  // namespace voxdag::query
