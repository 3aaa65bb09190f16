#include "tests/oracle/voxels.h"

#include <algorithm>

#include "tests/oracle/overlap.h"

namespace oracle {
namespace {

// Marks the voxels that `triangle` sets in the cube of `edge` voxels at (x, y, z) of the region.
void mark(const Triangle& triangle, const Region& region, int x, int y, int z, int edge,
          Voxels& out) {
  const Point low = {(region.low[0] + x) * kUnits, (region.low[1] + y) * kUnits,
                     (region.low[2] + z) * kUnits};
  if (!touches(triangle, low, edge * kUnits)) return;
  if (edge == 1) return out.set(x, y, z);
  const int half = edge / 2;
  for (int i = 0; i < 8; ++i)
    mark(triangle, region, x + (i & 1 ? half : 0), y + (i & 2 ? half : 0), z + (i & 4 ? half : 0),
         half, out);
}

}  // namespace

uint64_t Voxels::count() const {
  return static_cast<uint64_t>(std::count(set_.begin(), set_.end(), true));
}

Voxels voxelize(const Triangles& triangles, const Region& region) {
  Voxels out(region.edge);
  for (const Triangle& t : triangles) mark(t, region, 0, 0, 0, region.edge, out);
  return out;
}

Voxels voxelize_one_by_one(const Triangles& triangles, const Region& region) {
  Voxels out(region.edge);
  for (const Triangle& t : triangles)
    for (int x = 0; x < region.edge; ++x)
      for (int y = 0; y < region.edge; ++y)
        for (int z = 0; z < region.edge; ++z)
          if (touches(t,
                      {(region.low[0] + x) * kUnits, (region.low[1] + y) * kUnits,
                       (region.low[2] + z) * kUnits},
                      kUnits))
            out.set(x, y, z);
  return out;
}

}  // namespace oracle
