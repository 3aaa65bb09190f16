#include "query/verify/interior_sample.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/crossing.h"
#include "core/geometry/overlap.h"

namespace voxdag::query {
namespace {

struct SampledVoxel {
  int64_t low[3];    // low corner, in lattice units
  int64_t left[3];   // by axis: sum of the signs of the crossings before the center
  int64_t total[3];  // by axis: sum of the signs of all crossings
  bool is_touched;   // a triangle touches the voxel
};

std::vector<SampledVoxel> draw_voxels(const Grid& grid, uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::vector<SampledVoxel> voxels(kInteriorVoxels);
  for (SampledVoxel& voxel : voxels) {
    voxel = {};
    for (int64_t& low : voxel.low)
      low = static_cast<int64_t>(engine() % static_cast<uint64_t>(grid.resolution())) *
            kUnitsPerVoxel;
  }
  return voxels;
}

void add(const FixedTriangle& t, SampledVoxel& voxel) {
  if (!voxel.is_touched) voxel.is_touched = triangle_touches_cube(t, voxel.low, kUnitsPerVoxel);
  int64_t center[3];
  bool is_between[3];
  for (int a = 0; a < 3; ++a) {
    center[a] = voxel.low[a] + kUnitsPerVoxel / 2;
    is_between[a] = t.low(a) <= center[a] && center[a] <= t.high(a);
  }
  for (int a = 0; a < 3; ++a) {
    if (!is_between[(a + 1) % 3] || !is_between[(a + 2) % 3]) continue;
    const WideRowTest test(t, a);
    if (!test.crosses(center)) continue;
    voxel.total[a] += test.sign();
    if (test.is_beyond(center)) voxel.left[a] += test.sign();
  }
}

// Converts a snapped triangle to integer coordinates. Returns false if a coordinate is too large.
bool convert(const SnappedTriangle& snapped, FixedTriangle& out) {
  for (int i = 0; i < 3; ++i)
    for (int a = 0; a < 3; ++a) {
      if (!(std::abs(snapped.v[i][a]) < static_cast<double>(kCoordinateLimit))) return false;
      out.v[i][a] = static_cast<int64_t>(snapped.v[i][a]);
    }
  return true;
}

int64_t winding_number(SolidRule rule, int64_t crossings) {
  return rule == SolidRule::kParity ? crossings & 1 : crossings;
}

bool is_closed(SolidRule rule, const SampledVoxel& voxel) {
  bool closed = true;
  for (int a = 0; a < 3; ++a)
    closed &= winding_number(rule, voxel.total[a]) == 0 &&
              winding_number(rule, voxel.left[a]) == winding_number(rule, voxel.left[0]);
  return closed;
}

[[noreturn]] void refuse(const std::string& path, const SampledVoxel& voxel, bool expected) {
  std::string place;
  for (const int64_t low : voxel.low) place += " " + std::to_string(low / kUnitsPerVoxel);
  throw Error(ErrorCode::kCorrupt,
              path + ": voxel" + place +
                  (voxel.is_touched ? " is not set, but a triangle touches it"
                   : expected       ? " is not set, but it is inside the scene's surface"
                                    : " is set, but it is outside the scene's surface"));
}

// Updates the sums of crossings and is_touched of all sampled voxels with the triangles of the
// scene. Returns false if a triangle was left out because a coordinate was too large.
bool add_scene(TriangleSource& scene, const Grid& grid, std::vector<SampledVoxel>& voxels,
               Progress& progress, const CancelToken& cancel) {
  bool is_complete = true;
  progress.begin_stage("interior", scene.declared_triangles(), "triangles");
  scene.for_each_batch([&](std::span<const WorldTriangle> batch) {
    cancel.check();
    progress.advance(batch.size());
    for (const WorldTriangle& world : batch) {
      SnappedTriangle snapped = world;
      for (auto& vertex : snapped.v) snap_vertices(grid, vertex);
      FixedTriangle triangle;
      if (!convert(snapped, triangle)) {
        is_complete = false;
        continue;
      }
      for (SampledVoxel& voxel : voxels) add(triangle, voxel);
    }
  });
  progress.end_stage();
  return is_complete;
}

// True if the voxel and its neighbors are set, and all of them are in the grid.
bool is_surrounded(const voxdag_reader::File& file, const int64_t (&at)[3], int64_t edge) {
  for (int a = 0; a < 3; ++a)
    for (const int64_t step : {-1, 1}) {
      int64_t p[3] = {at[0], at[1], at[2]};
      p[a] += step;
      if (p[a] < 0 || p[a] >= edge || !file.voxel(p[0], p[1], p[2])) return false;
    }
  return true;
}

}  // namespace

InteriorReport compare_enclosed(const voxdag_reader::File& file, TriangleSource& scene,
                                const Grid& grid, uint64_t seed, Progress& progress,
                                const CancelToken& cancel) {
  std::vector<SampledVoxel> voxels = draw_voxels(grid, seed);
  add_scene(scene, grid, voxels, progress, cancel);
  InteriorReport report;
  for (const SampledVoxel& voxel : voxels) {
    const int64_t at[3] = {voxel.low[0] / kUnitsPerVoxel, voxel.low[1] / kUnitsPerVoxel,
                           voxel.low[2] / kUnitsPerVoxel};
    const bool is_set = file.voxel(at[0], at[1], at[2]);
    if (voxel.is_touched ? !is_set : is_set && !is_surrounded(file, at, grid.resolution()))
      refuse(file.path(), voxel, voxel.is_touched);
    ++report.voxels;
    report.inside += !voxel.is_touched && is_set ? 1 : 0;
  }
  return report;
}

InteriorReport compare_interior(const voxdag_reader::File& file, TriangleSource& scene,
                                const Grid& grid, SolidRule rule, uint64_t seed, Progress& progress,
                                const CancelToken& cancel) {
  std::vector<SampledVoxel> voxels = draw_voxels(grid, seed);
  InteriorReport report;
  report.is_closed = add_scene(scene, grid, voxels, progress, cancel);
  for (const SampledVoxel& voxel : voxels) report.is_closed &= is_closed(rule, voxel);
  for (const SampledVoxel& voxel : voxels) {
    if (!voxel.is_touched && !report.is_closed) continue;
    const bool is_inside = winding_number(rule, voxel.left[0]) != 0;
    const bool expected = voxel.is_touched || is_inside;
    if (file.voxel(voxel.low[0] / kUnitsPerVoxel, voxel.low[1] / kUnitsPerVoxel,
                   voxel.low[2] / kUnitsPerVoxel) != expected)
      refuse(file.path(), voxel, expected);
    ++report.voxels;
    report.inside += !voxel.is_touched && is_inside ? 1 : 0;
  }
  return report;
}

}  // namespace voxdag::query
