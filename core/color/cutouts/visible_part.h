// The visible part of a triangle whose material cuts out texels. Decides for each voxel whether the
// triangle is visible in it. The decision depends on the triangle, the visible texels and the voxel
// alone.
//
// The part of the triangle in the voxel's closed cube is a convex polygon. Mapped to the image, it
// covers texels, which are squares. The triangle is visible in the voxel if the polygon covers a
// visible texel. To cover a texel, the polygon must reach at least 2^-16 of a texel's edge into the
// square. So a polygon that ends at the border of a texel does not cover the texel. If the polygon
// covers no texel at all, the triangle is visible in the voxel if the polygon touches a visible
// texel. All values are computed in IEEE doubles, in the order of the code.
//
// A larger cube is first tested quickly, by the texels in a slightly enlarged box around the cube's
// polygon. If all these texels are visible, the triangle is visible in all voxels of the cube that
// it touches. If none is visible, the triangle is hidden in all these voxels.
#pragma once

#include <array>
#include <cstdint>

#include "core/color/cutouts/cutouts.h"
#include "core/color/surface.h"
#include "core/geometry/cube.h"

namespace voxdag {

class VisiblePart {
 public:
  // The grid of `surface` has 2^grid_levels voxels per edge. The cutouts must outlive this object.
  VisiblePart(const FixedSurface& surface, const Cutouts& cutouts, uint32_t grid_levels);

  enum class Sight { kHidden, kVisible, kMixed };
  // Returns kHidden if the triangle is hidden in all voxels of the cube that it touches, and
  // kVisible if it is visible in all these voxels. Returns kMixed if neither is certain.
  Sight sight(const Cube& cube) const;
  // True if the triangle is visible in a voxel. The triangle must touch the voxel.
  bool is_visible(const std::array<int64_t, 3>& voxel) const;
  // True if the triangle is visible in a voxel of the cube. The triangle must touch the cube.
  bool is_visible_in(const Cube& cube) const;

  const FixedTriangle& triangle() const { return triangle_; }

 private:
  struct Point {
    double at[3];     // relative to the cube's low corner, in lattice units (1/256 voxel)
    double texel[2];  // position in the image, in texels
  };
  struct Polygon {
    // Cutting by a cube's six planes adds at most six corners to a triangle's three. Rounding can
    // add a few more.
    static constexpr int kMaxPoints = 16;
    int count = 0;
    Point points[kMaxPoints];
  };
  // A box in the image, with coordinates in texels.
  struct Box {
    double low[2], high[2];
  };

  // The outline of a polygon in the image: its box and its edges.
  struct Outline {
    // The edge's function is nu * (u - from[0]) + nv * (v - from[1]). It is 0 on the edge. Its
    // values on the polygon are from `least` to `most`.
    struct Edge {
      double nu, nv, from[2], least, most;
    };
    int count;
    double low[2], high[2];
    Edge edges[Polygon::kMaxPoints];
  };
  // A block of texels of a level of the mask.
  struct Block {
    uint32_t level, x, y;
  };

  static void clip(const Polygon& from, int axis, double sign, double bound, Polygon& inside);
  Polygon part_in(const std::array<int64_t, 3>& low, int64_t edge, double margin) const;
  Sight sight_of(const Polygon& polygon) const;
  // True if the polygon reaches `depth`, in texels, into a visible texel (or, if `visible` is
  // false, into a hidden texel). With a negative depth, the texels are enlarged instead.
  bool covers(const Polygon& polygon, bool visible, double depth) const;
  bool covers(const Outline& outline, bool visible, double depth, uint32_t level, uint32_t x,
              uint32_t y) const;
  Outline outline_of(const Polygon& polygon, const std::array<double, 2>& period) const;
  Block block_around(const Outline& outline) const;
  Box square_of(uint32_t level, uint32_t x, uint32_t y, double depth) const;

  FixedTriangle triangle_;
  const AlphaMask* mask_;
  std::array<Wrap, 2> wrap_;
  const uint32_t grid_levels_;
  bool is_hidden_;       // the material cuts out the complete triangle
  double texels_[3][2];  // positions of the corners in the image, in texels
};

}  // namespace voxdag
