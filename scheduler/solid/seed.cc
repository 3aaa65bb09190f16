#include "scheduler/solid/seed.h"

#include <algorithm>
#include <span>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/geometry/overlap.h"
#include "scheduler/spec/unbuildable_job.h"

namespace voxdag {
namespace {

std::string point_text(const std::array<double, 3>& point) {
  return number_text(point[0]) + "," + number_text(point[1]) + "," + number_text(point[2]);
}

// True if the triangle touches one of the voxels in [low, high) along each axis.
bool touches_voxels(const FixedTriangle& triangle, const CubeVoxel& low, const CubeVoxel& high) {
  for (uint32_t x = low[0]; x < high[0]; ++x)
    for (uint32_t y = low[1]; y < high[1]; ++y)
      for (uint32_t z = low[2]; z < high[2]; ++z) {
        const int64_t corner[3] = {x * kUnitsPerVoxel, y * kUnitsPerVoxel, z * kUnitsPerVoxel};
        if (triangle_touches_cube(triangle, corner, kUnitsPerVoxel)) return true;
      }
  return false;
}

}  // namespace

bool is_in_shell(const Seed& seed, uint32_t grid_levels, TriangleStream& triangles,
                 const CancelToken& cancel) {
  // The walking cube can be partly outside the grid, where no voxel is set.
  const auto resolution = int64_t{1} << grid_levels;
  const int64_t cube_edge = int64_t{seed.radius} + 1;
  CubeVoxel low{}, high{};
  int64_t cube_corner[3];
  for (size_t a = 0; a < 3; ++a) {
    const int64_t first = int64_t{seed.voxel[a]} - seed.radius / 2;
    cube_corner[a] = first * kUnitsPerVoxel;
    low[a] = static_cast<uint32_t>(std::max<int64_t>(first, 0));
    high[a] = static_cast<uint32_t>(std::min(first + cube_edge, resolution));
  }
  std::array<FixedTriangle, 256> batch;
  while (const size_t n = triangles.read(batch)) {
    cancel.check();
    for (const FixedTriangle& triangle : std::span(batch).first(n))
      if (triangle_touches_cube(triangle, cube_corner, cube_edge * kUnitsPerVoxel) &&
          touches_voxels(triangle, low, high))
        return true;
  }
  return false;
}

std::optional<Seed> seed_of(const GeometryOptions& options, const Grid& grid) {
  if (!options.seed) return std::nullopt;
  Seed seed{{}, point_text(*options.seed), options.radius};
  std::array<double, 3> snapped = *options.seed;
  snap_vertices(grid, snapped);
  const auto end = static_cast<double>(grid.resolution() * kUnitsPerVoxel);
  for (size_t a = 0; a < 3; ++a) {
    if (!(snapped[a] >= 0 && snapped[a] < end))
      throw Error(ErrorCode::kInvalidInput,
                  option_text("seed", seed.text) +
                      ": the point is outside the grid, whose low corner is " +
                      point_text(grid.origin) + " and whose edge is " + number_text(grid.edge) +
                      ": expected a point in the grid");
    seed.voxel[a] = static_cast<uint32_t>(static_cast<int64_t>(snapped[a]) / kUnitsPerVoxel);
  }
  return seed;
}

std::optional<CubeVoxel> seed_in(const std::optional<Seed>& seed, const Cube& cube,
                                 uint32_t grid_levels) {
  if (!seed) return std::nullopt;
  const auto edge = static_cast<uint64_t>(cube.edge_voxels(grid_levels));
  CubeVoxel out{};
  for (size_t a = 0; a < 3; ++a) {
    const uint64_t low = cube.position[a] * edge;
    if (seed->voxel[a] < low || seed->voxel[a] >= low + edge) return std::nullopt;
    out[a] = static_cast<uint32_t>(seed->voxel[a] - low);
  }
  return out;
}

CubeVoxel start_position(const Seed& seed, uint32_t radius, uint32_t grid_levels) {
  CubeVoxel start = seed.voxel;
  for (uint32_t& coordinate : start) coordinate += (uint32_t{1} << grid_levels) - radius / 2;
  return start;
}

void refuse_seed_in_shell(const Seed& seed) {
  if (seed.radius > 0)
    throw UnbuildableJob(ErrorCode::kInvalidInput,
                         option_text("seed", seed.text) + ": the surface touches the cube of " +
                             std::to_string(seed.radius + 1) +
                             " voxels per edge around this point, which " +
                             option_text("radius", std::to_string(seed.radius)) +
                             " needs: expected a point farther from surfaces, or a smaller radius");
  throw UnbuildableJob(ErrorCode::kInvalidInput,
                       option_text("seed", seed.text) +
                           ": the surface touches the voxel of this point: expected a "
                           "point in empty space, at least a voxel away from surfaces");
}

}  // namespace voxdag
