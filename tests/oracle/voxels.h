// The voxels of a region that triangles set.
#pragma once

#include <vector>

#include "tests/oracle/triangle.h"

namespace oracle {

class Voxels {
 public:
  explicit Voxels(int edge) : edge_(edge), set_(static_cast<size_t>(edge) * edge * edge) {}
  int edge() const { return edge_; }
  // Coordinates are relative to the region's low corner.
  bool at(int x, int y, int z) const { return set_[index(x, y, z)]; }
  void set(int x, int y, int z) { set_[index(x, y, z)] = true; }
  uint64_t count() const;
  bool operator==(const Voxels&) const = default;

 private:
  size_t index(int x, int y, int z) const {
    return (static_cast<size_t>(x) * edge_ + y) * edge_ + z;
  }
  int edge_;
  std::vector<bool> set_;
};

// Sets a voxel if and only if one of the triangles touches its closed cube. The region's edge is a
// power of two. Parts of the region that a triangle does not touch are skipped.
Voxels voxelize(const Triangles& triangles, const Region& region);
// Like voxelize(), but tests every voxel with every triangle, which is slow.
Voxels voxelize_one_by_one(const Triangles& triangles, const Region& region);

}  // namespace oracle
