#include <algorithm>
#include <cstdio>

#include "bench/selftest/run.h"
#include "bench/selftest/scenes.h"
#include "core/backend/memory_stream.h"
#include "core/base/clock.h"
#include "core/base/parallel_for.h"
#include "core/geometry/overlap.h"

namespace voxdag::selftest {
namespace {

// Ignores its data, so that the cost of a sink is not measured.
class NullSink : public SubDagSink {
 public:
  void bricks(const BrickLevelView&) override {}
  void nodes(const NodeLevelView&) override {}
};

struct Subvolume {
  Cube cube;
  std::vector<FixedTriangle> triangles;
};

bool touches(const FixedTriangle& t, const Cube& cube, uint32_t grid_levels) {
  const int64_t edge = cube.edge_voxels(grid_levels) * kUnitsPerVoxel;
  const int64_t low[3] = {cube.position[0] * edge, cube.position[1] * edge,
                          cube.position[2] * edge};
  return triangle_touches_cube(t, low, edge);
}

// Splits a subvolume into octants until their edge is at most options.subvolume_edge voxels.
// Appends the octants that contain triangles to `out`.
void divide(Subvolume whole, const BenchOptions& options, std::vector<Subvolume>& out) {
  if (whole.triangles.empty()) return;
  if (whole.cube.edge_voxels(options.grid_levels) <= options.subvolume_edge) {
    out.push_back(std::move(whole));
    return;
  }
  for (int c = 0; c < 8; ++c) {
    Subvolume child{whole.cube.child(c), {}};
    for (const FixedTriangle& t : whole.triangles)
      if (touches(t, child.cube, options.grid_levels)) child.triangles.push_back(t);
    divide(std::move(child), options, out);
  }
}

struct Totals {
  uint64_t voxels = 0, svo_nodes = 0, dag_nodes = 0, skipped = 0;
  void add(const Totals& o) {
    voxels += o.voxels;
    svo_nodes += o.svo_nodes;
    dag_nodes += o.dag_nodes;
    skipped += o.skipped;
  }
};

void build(Backend& backend, const Subvolume& subvolume, const BenchOptions& options,
           Totals& sums) {
  MemoryStream stream(subvolume.triangles);
  MemoryBudget budget(options.worker_bytes);
  const CancelToken never;
  NullSink sink;
  SubDagSummary summary;
  if (backend.build({options.grid_levels, subvolume.cube, 64}, stream, budget, never, sink,
                    summary) == BuildOutcome::kNeedsSplit)
    ++sums.skipped;
  else
    sums.add({summary.voxels, summary.svo_nodes, summary.dag_nodes});
}

void measure(const Subject& subject, unsigned workers, const std::string& scene,
             const std::vector<Subvolume>& subvolumes, const BenchOptions& options) {
  std::vector<std::unique_ptr<Backend>> backends;
  for (unsigned w = 0; w < workers; ++w) backends.push_back(subject.open());
  double best = 0;
  Totals sums;
  for (int repetition = 0; repetition < 3; ++repetition) {
    std::vector<Totals> parts(workers);
    const double start = wall_seconds();
    parallel_for(workers, subvolumes.size(), [&](unsigned worker, size_t i) {
      build(*backends[worker], subvolumes[i], options, parts[worker]);
    });
    const double seconds = wall_seconds() - start;
    if (repetition == 0 || seconds < best) best = seconds;
    sums = {};
    for (const Totals& part : parts) sums.add(part);
  }
  std::printf("%-10s %-22s %7u %10zu %14llu %12llu %12llu %9.3f %10.1f", scene.c_str(),
              subject.name.c_str(), workers, subvolumes.size(),
              static_cast<unsigned long long>(sums.voxels),
              static_cast<unsigned long long>(sums.svo_nodes),
              static_cast<unsigned long long>(sums.dag_nodes), best,
              1e-6 * static_cast<double>(sums.voxels) / best);
  if (sums.skipped)
    std::printf("  (%llu subvolumes do not fit the budget, not counted)",
                static_cast<unsigned long long>(sums.skipped));
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace

void bench(const std::vector<Subject>& subjects, BenchOptions options) {
  if (options.subvolume_edge == 0)
    options.subvolume_edge = std::max(kSmallestEdge, int64_t{1} << options.grid_levels >> 3);
  std::printf("R %u, subvolumes of %lld, best of three\n", 1u << options.grid_levels,
              static_cast<long long>(options.subvolume_edge));
  std::printf("%-10s %-22s %7s %10s %14s %12s %12s %9s %10s\n", "scene", "backend", "workers",
              "subvolumes", "voxels", "octree", "sub-DAGs", "seconds", "Mvoxel/s");
  for (Scene& scene : std::vector<Scene>{scan(100000, options.grid_levels),
                                         building(280000, options.grid_levels)}) {
    std::vector<Subvolume> subvolumes;
    divide({Cube{}, std::move(scene.triangles)}, options, subvolumes);
    measure({"cpu", [] { return make_cpu_backend(); }}, options.cpu_workers, scene.name, subvolumes,
            options);
    for (const Subject& subject : subjects)
      measure(subject, options.workers, scene.name, subvolumes, options);
  }
}

}  // namespace voxdag::selftest
