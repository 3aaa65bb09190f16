#include "query/verify/interior_sample.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/geometry/crossing.h"
#include "core/geometry/overlap.h"
#include "query/verify/empty_cubes.h"

namespace voxdag::query {
namespace {

struct SampledVoxel {
  int64_t low[3];    // low corner, in lattice units (1/256 voxel)
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

// Calls add_triangle() for each triangle of the scene, in integer coordinates. Leaves out triangles
// that convert() refuses. Returns false if it has left out a triangle.
template <class Add>
bool add_scene(TriangleSource& scene, const Grid& grid, Progress& progress,
               const CancelToken& cancel, const Add& add_triangle) {
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
      add_triangle(triangle);
    }
  });
  progress.end_stage();
  return is_complete;
}

// True if all six neighbors of the voxel are in the grid and set.
bool is_surrounded(const voxdag_reader::File& file, const VoxelPlace& at, int64_t edge) {
  for (size_t a = 0; a < 3; ++a)
    for (const int64_t step : {-1, 1}) {
      VoxelPlace p = at;
      p[a] += step;
      if (p[a] < 0 || p[a] >= edge || !file.voxel(p[0], p[1], p[2])) return false;
    }
  return true;
}

VoxelPlace place_of(const SampledVoxel& voxel) {
  return {voxel.low[0] / kUnitsPerVoxel, voxel.low[1] / kUnitsPerVoxel,
          voxel.low[2] / kUnitsPerVoxel};
}

// A step of empty cubes onto a sampled voxel that is set (EmptyCubes::Step). The solid is right
// only if a triangle touches at least one of the voxels in `stops`, which include the sampled
// voxel.
struct SampledStep {
  size_t sample;  // index of the sampled voxel
  std::vector<VoxelPlace> stops;
  VoxelPlace low, high;  // bounding box of `stops`, in lattice units
  bool is_stopped = false;
};

SampledStep step_of(size_t sample, std::vector<VoxelPlace> stops) {
  SampledStep step{sample, std::move(stops), {}, {}};
  step.low.fill(INT64_MAX);
  step.high.fill(INT64_MIN);
  for (VoxelPlace& stop : step.stops)
    for (size_t a = 0; a < 3; ++a) {
      stop[a] *= kUnitsPerVoxel;
      step.low[a] = std::min(step.low[a], stop[a]);
      step.high[a] = std::max(step.high[a], stop[a] + kUnitsPerVoxel);
    }
  return step;
}

void add(const FixedTriangle& t, SampledStep& step) {
  if (step.is_stopped) return;
  for (int a = 0; a < 3; ++a)
    if (t.high(a) < step.low[static_cast<size_t>(a)] ||
        t.low(a) > step.high[static_cast<size_t>(a)])
      return;
  for (const VoxelPlace& stop : step.stops) {
    const int64_t low[3] = {stop[0], stop[1], stop[2]};
    if (triangle_touches_cube(t, low, kUnitsPerVoxel)) step.is_stopped = true;
  }
}

// Returns the possible steps of empty cubes onto those sampled voxels that are set. For each
// sampled voxel that is not set, checks that an empty cube contains it; otherwise throws
// Error{kCorrupt}.
std::vector<SampledStep> sample_steps(const voxdag_reader::File& file, const Grid& grid,
                                      const std::vector<SampledVoxel>& voxels, uint32_t radius) {
  std::vector<SampledStep> steps;
  for (size_t i = 0; i < voxels.size(); ++i) {
    const VoxelPlace at = place_of(voxels[i]);
    const bool is_set = file.voxel(at[0], at[1], at[2]);
    if (is_set && is_surrounded(file, at, grid.resolution())) continue;
    const EmptyCubes cubes(file, grid.resolution(), at, static_cast<int>(radius));
    if (!is_set) {
      if (!cubes.has_center()) refuse(file.path(), voxels[i], true);
      continue;
    }
    for (int axis = 0; axis < 3; ++axis)
      for (const int side : {-1, 1})
        if (auto step = cubes.step_from(axis, side); step.has_cubes)
          steps.push_back(step_of(i, std::move(step.stops)));
  }
  return steps;
}

}  // namespace

InteriorReport compare_enclosed(const voxdag_reader::File& file, TriangleSource& scene,
                                const Grid& grid, uint32_t radius, uint64_t seed,
                                Progress& progress, const CancelToken& cancel) {
  std::vector<SampledVoxel> voxels = draw_voxels(grid, seed);
  std::vector<SampledStep> steps = sample_steps(file, grid, voxels, radius);
  add_scene(scene, grid, progress, cancel, [&](const FixedTriangle& triangle) {
    for (SampledVoxel& voxel : voxels) add(triangle, voxel);
    for (SampledStep& step : steps) add(triangle, step);
  });
  for (const SampledStep& step : steps)
    if (!step.is_stopped) refuse(file.path(), voxels[step.sample], false);
  InteriorReport report;
  for (const SampledVoxel& voxel : voxels) {
    const VoxelPlace at = place_of(voxel);
    const bool is_set = file.voxel(at[0], at[1], at[2]);
    if (voxel.is_touched && !is_set) refuse(file.path(), voxel, true);
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
  report.is_closed = add_scene(scene, grid, progress, cancel, [&](const FixedTriangle& triangle) {
    for (SampledVoxel& voxel : voxels) add(triangle, voxel);
  });
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
