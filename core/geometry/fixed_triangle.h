// A triangle on the fixed-point lattice: coordinates in units of 1/256 voxel, all of them odd, so
// that no vertex is ever on a voxel boundary (a multiple of 256).
#pragma once

#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag {

// kUnitsPerVoxel is the number of lattice units along the edge of a voxel. kUnitBits is log2 of
// this number.
inline constexpr int kUnitBits = 8;
inline constexpr int64_t kUnitsPerVoxel = int64_t{1} << kUnitBits;
// Maximum magnitude of a coordinate, so that products of the overlap test fit in 128 bits.
inline constexpr int64_t kCoordinateLimit = int64_t{1} << 40;

struct FixedTriangle {
  int64_t v[3][3];  // [vertex][axis x, y, z]

  VOXDAG_HD int64_t low(int axis) const {
    const int64_t m = v[0][axis] < v[1][axis] ? v[0][axis] : v[1][axis];
    return m < v[2][axis] ? m : v[2][axis];
  }
  VOXDAG_HD int64_t high(int axis) const {
    const int64_t m = v[0][axis] > v[1][axis] ? v[0][axis] : v[1][axis];
    return m > v[2][axis] ? m : v[2][axis];
  }
};

}  // namespace voxdag
