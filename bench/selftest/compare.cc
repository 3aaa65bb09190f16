#include <cstdio>

#include "bench/selftest/run.h"
#include "bench/selftest/scenes.h"
#include "core/backend/memory_stream.h"
#include "core/base/clock.h"

namespace voxdag::selftest {
namespace {

constexpr uint64_t kBudgetBytes = uint64_t{4} << 30;

struct Built {
  BuildOutcome outcome = BuildOutcome::kBuilt;
  SubDag dag;
  SubDagSummary summary;
  double seconds = 0;
};

Built build(Backend& backend, const SubvolumeTask& task, const Scene& scene) {
  Built built;
  MemoryStream stream(scene.triangles);
  MemoryBudget budget(kBudgetBytes);
  const CancelToken never;
  const double start = wall_seconds();
  built.outcome = backend.build(task, stream, budget, never, built.dag, built.summary);
  built.seconds = wall_seconds() - start;
  return built;
}

// Returns the first difference, or "" if there is no difference.
std::string difference(const Built& a, const Built& b) {
  if (a.outcome != b.outcome) return "outcome";
  if (a.summary.voxels != b.summary.voxels) return "voxel count";
  if (a.summary.svo_nodes != b.summary.svo_nodes) return "octree node count";
  if (a.dag.brick_masks != b.dag.brick_masks) return "bricks";
  if (a.dag.levels.size() != b.dag.levels.size()) return "number of levels";
  for (size_t l = 0; l < a.dag.levels.size(); ++l)
    if (!(a.dag.levels[l] == b.dag.levels[l]))
      return "level " + std::to_string(a.dag.levels[l].level);
  if (a.summary.dag_nodes != b.summary.dag_nodes) return "DAG node count";
  if (a.summary.root_hash != b.summary.root_hash) return "root hash";
  return "";
}

class Table {
 public:
  explicit Table(const std::vector<Subject>& subjects) : cpu_(make_cpu_backend()) {
    std::printf("%-12s %6s %5s %4s %12s %10s", "scene", "R", "edge", "bits", "voxels", "DAG nodes");
    for (const Subject& subject : subjects) {
      backends_.push_back(subject.open());
      std::printf("  %-22s", subject.name.c_str());
    }
    std::printf("\n");
  }

  void row(const SubvolumeTask& task, const Scene& scene) {
    const Built truth = build(*cpu_, task, scene);
    std::printf("%-12s 2^%-4u %5lld %4u %12llu %10llu", scene.name.c_str(), task.grid_levels,
                static_cast<long long>(task.cube.edge_voxels(task.grid_levels)), task.hash_bits,
                static_cast<unsigned long long>(truth.summary.voxels),
                static_cast<unsigned long long>(truth.summary.dag_nodes));
    for (const auto& backend : backends_) {
      const Built built = build(*backend, task, scene);
      const std::string what = difference(built, truth);
      all_equal = all_equal && what.empty();
      if (what.empty())
        std::printf("  equal %8.1f Mvoxel/s",
                    1e-6 * static_cast<double>(built.summary.voxels) / built.seconds);
      else
        std::printf("  DIFFERS: %-13s", what.c_str());
    }
    std::printf("\n");
    std::fflush(stdout);
  }

  bool all_equal = true;

 private:
  const std::unique_ptr<Backend> cpu_;
  std::vector<std::unique_ptr<Backend>> backends_;
};

}  // namespace

bool compare_with_cpu(const std::vector<Subject>& subjects, Comparison comparison) {
  const bool minimal = comparison == Comparison::kMinimal;
  const bool quick = minimal || comparison == Comparison::kQuick;
  Table table(minimal ? std::vector<Subject>{subjects.front()} : subjects);
  const SubvolumeTask cubes[] = {{6, {}, 4},
                                 {2, {}, 64},
                                 {13, {7, {100, 3, 77}}, 64},
                                 {20, {14, {16383, 0, 9999}}, 16},
                                 {9, {2, {1, 3, 2}}, 64},
                                 {20, {12, {1, 4095, 2048}}, 64},
                                 {11, {2, {3, 0, 1}}, 5}};
  for (const SubvolumeTask& task : cubes) {
    const int64_t edge = task.cube.edge_voxels(task.grid_levels);
    if (quick && edge > 128) continue;
    for (const Scene& scene :
         tricky_scenes(static_cast<uint64_t>(edge), task.cube, task.grid_levels, 60))
      table.row(task, scene);
    if (minimal) return table.all_equal;
  }
  const uint64_t triangles = quick ? 8000 : 100000;
  for (const uint32_t levels : quick ? std::vector<uint32_t>{7} : std::vector<uint32_t>{8, 10, 11})
    for (const Scene& scene : {scan(triangles, levels), building(triangles, levels)})
      for (const uint32_t hash_bits : {64u, 8u}) table.row({levels, {}, hash_bits}, scene);
  return table.all_equal;
}

}  // namespace voxdag::selftest
