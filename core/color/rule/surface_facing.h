// The orientation, area and material of a triangle, from which the normals and materials of cells
// are computed. docs/color.md, "Other attributes", states the rule.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/surface.h"

namespace voxdag::color {

// Unit of SurfaceFacing::area. This integer stands for 1/16 of the area of a cell's face, which is
// the cross section of the square prism around one column.
inline constexpr double kColumnArea = 1 << 20;

// A triangle's contribution to each cell that it touches.
struct SurfaceFacing {
  // A vector along the triangle's normal. Its length is the area of the triangle's part in the
  // prism around one covered column. Its dominant component is the area of this part's projection
  // along the column, so the component's magnitude is kColumnArea. All components are 0 for a
  // triangle without area.
  int64_t area[3] = {};
  bool is_backward = false;  // the normal's dominant component is negative
  uint32_t material = 0;
};

template <class Int>
VOXDAG_HD inline void set_area(const FixedTriangle& triangle, SurfaceFacing& facing) {
  Int n[3];
  normal_of(triangle, n);
  int dominant = magnitude(n[1]) > magnitude(n[0]) ? 1 : 0;
  if (magnitude(n[2]) > magnitude(n[dominant])) dominant = 2;
  if (n[dominant] == 0) return;
  const double scale = kColumnArea / to_double(magnitude(n[dominant]));
  for (int a = 0; a < 3; ++a) {
    const double length = to_double(magnitude(n[a])) * scale;
    const auto rounded = static_cast<int64_t>(length + 0.5);
    facing.area[a] = n[a] < 0 ? -rounded : rounded;
  }
  facing.is_backward = n[dominant] < 0;
}

// Returns the contribution of a triangle. `material` is the index of the name of its material
// (Material::number).
VOXDAG_HD inline SurfaceFacing facing_of(const FixedSurface& surface, uint32_t material) {
  SurfaceFacing facing;
  facing.material = material;
  if (is_narrow(surface.position))
    set_area<int64_t>(surface.position, facing);
  else
    set_area<int128>(surface.position, facing);
  if (!surface.is_flipped) return facing;
  for (int64_t& area : facing.area) area = -area;
  facing.is_backward = !facing.is_backward;
  return facing;
}

}  // namespace voxdag::color
