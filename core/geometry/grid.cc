#include "core/geometry/grid.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string>

#include "core/base/error.h"
#include "core/base/text.h"
#include "core/geometry/cube.h"

namespace voxdag {
namespace {

void check_levels(uint32_t levels) {
  if (levels < static_cast<uint32_t>(kMinGridLevels) ||
      levels > static_cast<uint32_t>(kMaxGridLevels))
    throw Error(ErrorCode::kInvalidInput,
                "a grid of 2^" + std::to_string(levels) + " voxels per edge: expected 2^2 to 2^20");
}

Grid centered(const WorldBounds& bounds, double edge, uint32_t levels) {
  Grid grid{levels, {}, edge};
  for (int a = 0; a < 3; ++a) {
    const double middle = bounds.empty ? 0.0 : 0.5 * (bounds.low[a] + bounds.high[a]);
    grid.origin[a] = middle - 0.5 * edge;
    if (!std::isfinite(grid.origin[a]) || !std::isfinite(edge))
      throw Error(ErrorCode::kLimit,
                  "the grid of edge " + number_text(edge) +
                      " around the scene is out of the range of doubles on the " + "xyz"[a] +
                      " axis: expected coordinates below 1e307");
  }
  return grid;
}

// Returns the edge of a grid of 2^levels voxels per edge.
double edge_of(double voxel_size, uint32_t levels) {
  return voxel_size * static_cast<double>(int64_t{1} << levels);
}

double largest_extent(const WorldBounds& bounds) {
  double extent = 0;
  if (!bounds.empty)
    for (int a = 0; a < 3; ++a) extent = std::max(extent, bounds.high[a] - bounds.low[a]);
  if (!std::isfinite(extent))
    throw Error(ErrorCode::kLimit,
                "the extent of the scene is out of the range of doubles: expected coordinates "
                "below 1e307");
  return extent;
}

// Returns a voxel size with which the scene fits in a grid of `levels` levels: the smallest size,
// rounded up to six digits.
std::string sufficient_voxel_size(double extent, uint32_t levels) {
  const double least = extent / edge_of(1, levels);
  // The last of six digits is 1e-6 to 1e-5 of the number.
  for (const double factor : {1.0, 1 + 2e-6, 1 + 1e-5}) {
    char text[40];
    char* const end =
        std::to_chars(text, text + sizeof text, least * factor, std::chars_format::general, 6).ptr;
    double rounded = 0;
    std::from_chars(text, end, rounded);
    if (extent < edge_of(rounded, levels))
      return std::string(text, static_cast<size_t>(end - text));
  }
  return number_text(std::nextafter(least, 2 * least));  // denormal numbers have fewer digits
}

// Two doubles in a vector register, which every supported processor has.
using Pair = double __attribute__((vector_size(16)));

// Returns floor(x) for |x| <= 2^51, and otherwise a number near x, which can have a fraction.
// Rounds to the nearest integer, and subtracts 1 if this has rounded up. There is no branch,
// because the CPU would mispredict a branch for half of all numbers.
Pair floor_of(Pair x) {
  constexpr Pair kNoFraction = {0x1.8p52, 0x1.8p52};
  const Pair nearest = (x + kNoFraction) - kNoFraction;
  return nearest - (nearest > x ? Pair{1, 1} : Pair{0, 0});
}

}  // namespace

void WorldBounds::add(const WorldBounds& other) {
  if (other.empty) return;
  for (int a = 0; a < 3; ++a) {
    low[a] = empty ? other.low[a] : std::min(low[a], other.low[a]);
    high[a] = empty ? other.high[a] : std::max(high[a], other.high[a]);
  }
  empty = false;
}

WorldBounds bounds_of(std::span<const WorldTriangle> triangles) {
  if (triangles.empty()) return {};
  // `low` and `high` have separate bounds for the first, the second and the third vertices of all
  // triangles. The loop below joins these three bounds.
  WorldTriangle low = triangles[0], high = triangles[0];
  for (const WorldTriangle& triangle : triangles)
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < 3; ++a) {
        low.v[i][a] = std::min(low.v[i][a], triangle.v[i][a]);
        high.v[i][a] = std::max(high.v[i][a], triangle.v[i][a]);
      }
  WorldBounds bounds{.empty = false};
  for (int a = 0; a < 3; ++a) {
    bounds.low[a] = std::min({low.v[0][a], low.v[1][a], low.v[2][a]});
    bounds.high[a] = std::max({high.v[0][a], high.v[1][a], high.v[2][a]});
  }
  return bounds;
}

Grid Grid::around(const WorldBounds& bounds, uint32_t levels) {
  check_levels(levels);
  const double extent = largest_extent(bounds);
  return centered(bounds, extent > 0 ? extent * (1.0 + 0x1p-15) : 1.0, levels);
}

Grid Grid::given(const std::array<double, 3>& origin, double edge, uint32_t levels) {
  check_levels(levels);
  const bool finite = std::isfinite(origin[0]) && std::isfinite(origin[1]) &&
                      std::isfinite(origin[2]) && std::isfinite(edge);
  if (!finite || !(edge > 0))
    throw Error(ErrorCode::kInvalidInput, "bounds " + number_text(origin[0]) + "," +
                                              number_text(origin[1]) + "," +
                                              number_text(origin[2]) + "," + number_text(edge) +
                                              ": expected finite X,Y,Z and an EDGE above 0");
  return {levels, origin, edge};
}

Grid Grid::with_voxel_size(const WorldBounds& bounds, double voxel_size, uint32_t levels,
                           uint32_t max_levels) {
  check_levels(levels);
  const uint32_t least = levels_for_voxel_size(bounds, voxel_size, max_levels);
  if (levels < least)
    throw Error(ErrorCode::kInvalidInput,
                "voxel size " + number_text(voxel_size) + ": the scene's largest extent " +
                    number_text(largest_extent(bounds)) + " does not fit in " +
                    std::to_string(int64_t{1} << levels) +
                    " voxels: expected a larger voxel size or a resolution of at least " +
                    std::to_string(int64_t{1} << least));
  return centered(bounds, edge_of(voxel_size, levels), levels);
}

uint32_t Grid::levels_for_voxel_size(const WorldBounds& bounds, double voxel_size,
                                     uint32_t max_levels) {
  if (!std::isfinite(voxel_size) || !(voxel_size > 0))
    throw Error(ErrorCode::kInvalidInput,
                "voxel size " + number_text(voxel_size) + ": expected a finite number above 0");
  const double extent = largest_extent(bounds);
  auto levels = static_cast<uint32_t>(kMinGridLevels);
  const auto fits = [&] { return extent == 0 || extent < edge_of(voxel_size, levels); };
  while (levels < max_levels && !fits()) ++levels;
  if (!fits())
    throw Error(ErrorCode::kInvalidInput,
                "voxel size " + number_text(voxel_size) + ": the scene's largest extent " +
                    number_text(extent) + " does not fit in 2^" + std::to_string(max_levels) +
                    " voxels: expected a voxel size of at least " +
                    sufficient_voxel_size(extent, max_levels));
  return levels;
}

void snap_vertices(const Grid& grid, std::span<double> coordinates) {
  // The factors of `scale`, 128 and the resolution, are powers of two. So multiplying by `scale` is
  // the same as multiplying first by the resolution and then by 128, as grid.h defines it.
  const double scale = 128.0 * static_cast<double>(grid.resolution());
  const auto& o = grid.origin;
  const Pair origins[3] = {{o[0], o[1]}, {o[2], o[0]}, {o[1], o[2]}};
  const auto snap = [&](Pair position, Pair origin) {
    return 2.0 * floor_of(((position - origin) / grid.edge) * scale) + 1.0;
  };
  double* x = coordinates.data();
  double* const end = x + coordinates.size();
  for (; end - x >= 6; x += 6)
    for (size_t i = 0; i < 3; ++i) {
      Pair position;
      std::memcpy(&position, x + 2 * i, sizeof position);
      position = snap(position, origins[i]);
      std::memcpy(x + 2 * i, &position, sizeof position);
    }
  if (x == end) return;
  const Pair low = snap(Pair{x[0], x[1]}, origins[0]), high = snap(Pair{x[2], x[2]}, origins[1]);
  x[0] = low[0];
  x[1] = low[1];
  x[2] = high[0];
}

SnapResult to_fixed(const Grid& grid, const SnappedTriangle& snapped, FixedTriangle& out) {
  const auto& u = snapped.v;
  const double end = static_cast<double>(grid.resolution() * kUnitsPerVoxel);
  const double limit = static_cast<double>(kCoordinateLimit);
  bool outside = false, far = false;
  for (int a = 0; a < 3; ++a) {
    const double low = std::min(std::min(u[0][a], u[1][a]), u[2][a]);
    const double high = std::max(std::max(u[0][a], u[1][a]), u[2][a]);
    outside |= high < 0 || low > end;
    far |= !(low > -limit && high < limit);
  }
  if (outside) return SnapResult::kOutside;
  if (far) return SnapResult::kTooFar;
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) out.v[i][a] = static_cast<int64_t>(u[i][a]);
  return SnapResult::kInside;
}

SnapResult snap_triangle(const Grid& grid, const WorldTriangle& world, FixedTriangle& out) {
  SnappedTriangle snapped = world;
  for (auto& vertex : snapped.v) snap_vertices(grid, vertex);
  return to_fixed(grid, snapped, out);
}

uint32_t levels_of_resolution(uint64_t resolution) {
  for (uint32_t levels = kMinGridLevels; levels <= static_cast<uint32_t>(kMaxGridLevels); ++levels)
    if (resolution == uint64_t{1} << levels) return levels;
  throw Error(ErrorCode::kInvalidInput, "resolution " + std::to_string(resolution) +
                                            ": expected a power of two from 4 to 1048576");
}

}  // namespace voxdag
