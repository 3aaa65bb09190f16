// The portable rasterizer. It visits the bricks of the triangle's box one after another, and tests
// each voxel of a brick with the integer tests of tile_triangle.h.
#include <algorithm>

#include "core/backend/cpu/raster/kernels.h"
#include "core/dag/brick.h"

namespace voxdag::cpu {
namespace {

// Voxels of a brick are numbered in Morton order: bits 2 - a and 5 - a of a voxel's number are its
// coordinate along axis a.
constexpr int low_bit(int axis) { return 4 >> axis; }
constexpr int high_bit(int axis) { return 32 >> axis; }
constexpr int voxel_bits(int axis, int k) {
  return (k & 1 ? low_bit(axis) : 0) | (k & 2 ? high_bit(axis) : 0);
}

// Returns the four voxels of the line along `axis` that starts at voxel 0.
constexpr uint64_t line_along(int axis) {
  return 1 | uint64_t{1} << low_bit(axis) | uint64_t{1} << high_bit(axis) |
         uint64_t{1} << (low_bit(axis) + high_bit(axis));
}

// For each of the 64 voxels of a brick: n.k (tile_triangle.h) at this voxel minus n.k at the
// brick's first voxel.
template <class Int>
struct VoxelOffsets {
  Int of[64];

  explicit VoxelOffsets(const Int (&normal)[3]) {
    for (int voxel = 0; voxel < 64; ++voxel) {
      of[voxel] = 0;
      for (int a = 0; a < 3; ++a) of[voxel] += normal[a] * brick_coordinate(voxel, a);
    }
  }
};

template <class Int>
uint64_t plane_mask(const VoxelOffsets<Int>& offsets, Int at_first, Int width) {
  uint64_t mask = 0;
  for (int voxel = 0; voxel < 64; ++voxel) {
    const Int value = at_first + offsets.of[voxel];
    mask |= static_cast<uint64_t>((value >= 0) & (value <= width)) << voxel;
  }
  return mask;
}

// Removes from `mask` the voxels whose column along `axis` is on the outer side of an edge. If the
// value of an edge (TileTriangle::Edge) is not negative anywhere in the brick, the edge removes
// nothing and is skipped. This is the usual case, because most edges cross few bricks.
template <class Edge>
void cut_by_edges(const Edge (&edges)[3], int axis, const int (&brick)[3], uint64_t& mask) {
  const int p = (axis + 1) % 3, q = (axis + 2) % 3;
  for (const Edge& edge : edges) {
    const int64_t at_first = edge.a * (4 * brick[p]) + edge.b * (4 * brick[q]) + edge.c;
    if (at_first + 3 * (std::min<int64_t>(edge.a, 0) + std::min<int64_t>(edge.b, 0)) >= 0) continue;
    for (int i = 0; i < 16; ++i)
      if (at_first + edge.a * (i & 3) + edge.b * (i >> 2) < 0)
        mask &= ~(line_along(axis) << (voxel_bits(p, i & 3) | voxel_bits(q, i >> 2)));
  }
}

// Returns the voxels of a brick whose coordinates along `axis` are in [first, last]. Coordinates
// are relative to the brick's first voxel.
uint64_t range_mask(int axis, int first, int last) {
  if (first <= 0 && last >= 3) return ~uint64_t{0};
  const int p = (axis + 1) % 3, q = (axis + 2) % 3;
  uint64_t mask = 0;
  for (int k = std::max(first, 0); k <= std::min(last, 3); ++k)
    for (int i = 0; i < 16; ++i)
      mask |= uint64_t{1} << (voxel_bits(axis, k) | voxel_bits(p, i & 3) | voxel_bits(q, i >> 2));
  return mask;
}

template <class Coordinate>
uint64_t brick_mask(const TileTriangle<Coordinate>& t,
                    const VoxelOffsets<typename TileTriangle<Coordinate>::Int>& offsets,
                    const int (&brick)[3]) {
  auto at_first = t.lowest;
  for (int a = 0; a < 3; ++a) at_first += t.normal[a] * (4 * brick[a]);
  uint64_t mask = plane_mask(offsets, at_first, t.width);
  for (int a = 0; a < 3 && mask != 0; ++a) {
    mask &= range_mask(a, t.first_voxel[a] - 4 * brick[a], t.last_voxel[a] - 4 * brick[a]);
    if (!t.inside) cut_by_edges(t.edges[a], a, brick, mask);
  }
  return mask;
}

// Returns the voxels of a brick that the rule kThin sets: the voxels in which the triangle crosses
// the row through the voxel's center along at least one axis.
template <class Coordinate>
uint64_t thin_brick_mask(const ThinTriangle<Coordinate>& t,
                         const VoxelOffsets<typename ThinTriangle<Coordinate>::Int>& offsets,
                         const int (&brick)[3]) {
  auto at_brick = t.normal[0] * (4 * brick[0]);
  for (int a = 1; a < 3; ++a) at_brick += t.normal[a] * (4 * brick[a]);
  if (t.inside) return plane_mask(offsets, at_brick + t.lowest, t.width);
  uint64_t mask = 0;
  for (int a = 0; a < 3; ++a) {
    if (t.width_along[a] < 0) continue;
    uint64_t along = plane_mask(offsets, at_brick + t.lowest_along[a], t.width_along[a]);
    cut_by_edges(t.edges[a], a, brick, along);
    mask |= along;
  }
  return mask;
}

// Returns false if the plane test excludes all voxels of the brick.
template <class Coordinate>
bool may_cross_plane(const TileTriangle<Coordinate>& t, const int (&brick)[3]) {
  auto low = t.lowest, high = t.lowest;
  for (int a = 0; a < 3; ++a) {
    const auto near = t.normal[a] * (4 * brick[a]), far = near + 3 * t.normal[a];
    low += std::min(near, far);
    high += std::max(near, far);
  }
  return high >= 0 && low <= t.width;
}

// Returns false if the plane test or the test of an edge excludes all voxels of the brick.
template <class Coordinate>
bool may_touch(const TileTriangle<Coordinate>& t, const int (&brick)[3]) {
  if (!may_cross_plane(t, brick)) return false;
  if (t.inside) return true;
  for (int d = 0; d < 3; ++d)
    for (const auto& edge : t.edges[d])
      if (edge.c + edge.a * (4 * brick[(d + 1) % 3] + (edge.a > 0 ? 3 : 0)) +
              edge.b * (4 * brick[(d + 2) % 3] + (edge.b > 0 ? 3 : 0)) <
          0)
        return false;
  return true;
}

// Calls visit(brick, index) for each brick of the triangle's box. `brick` has the brick's
// coordinates in the tile, in bricks, and `index` is its Morton index.
template <class Coordinate, class Visit>
void for_each_brick(const TileTriangle<Coordinate>& t, Visit visit) {
  int first[3], last[3];
  for (int a = 0; a < 3; ++a) {
    first[a] = t.first_voxel[a] / 4;
    last[a] = t.last_voxel[a] / 4;
  }
  int brick[3];
  for (brick[0] = first[0]; brick[0] <= last[0]; ++brick[0])
    for (brick[1] = first[1]; brick[1] <= last[1]; ++brick[1])
      for (brick[2] = first[2]; brick[2] <= last[2]; ++brick[2])
        visit(brick, kSpread[brick[0]] << 2 | kSpread[brick[1]] << 1 | kSpread[brick[2]]);
}

}  // namespace

template <class Coordinate>
void draw_exactly(const TileTriangle<Coordinate>& t, TileBricks& tile) {
  const VoxelOffsets offsets(t.normal);
  for_each_brick(t, [&](const int(&brick)[3], uint32_t index) {
    if (may_touch(t, brick)) tile.add(index, brick_mask(t, offsets, brick));
  });
}

template <class Coordinate>
void draw_thin_exactly(const ThinTriangle<Coordinate>& t, TileBricks& tile) {
  const VoxelOffsets offsets(t.normal);
  for_each_brick(t, [&](const int(&brick)[3], uint32_t index) {
    if (may_cross_plane(t, brick)) tile.add(index, thin_brick_mask(t, offsets, brick));
  });
}

template void draw_exactly(const TileTriangle<int32_t>&, TileBricks&);
template void draw_exactly(const TileTriangle<int64_t>&, TileBricks&);
template void draw_thin_exactly(const ThinTriangle<int32_t>&, TileBricks&);
template void draw_thin_exactly(const ThinTriangle<int64_t>&, TileBricks&);

void draw_wide(const TileTriangle<int64_t>& triangle, TileBricks& tile) {
  draw_exactly(triangle, tile);
}

void draw_thin_wide(const ThinTriangle<int64_t>& triangle, TileBricks& tile) {
  draw_thin_exactly(triangle, tile);
}

}  // namespace voxdag::cpu
