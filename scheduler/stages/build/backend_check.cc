// Implements difference_from_cpu() (choose_backend.h).

#include <span>
#include <vector>

#include "core/backend/memory_stream.h"
#include "scheduler/stages/build/choose_backend.h"

namespace voxdag {
namespace {

constexpr uint32_t kGridLevels = 9;
constexpr uint64_t kBudgetBytes = uint64_t{256} << 20;

// Returns `count` pseudorandom triangles anywhere in the grid. Their sizes range from a quarter of
// a voxel to a quarter of the grid. Every eighth triangle is a sliver.
std::vector<FixedTriangle> check_triangles(int count) {
  uint64_t state = 0x9e3779b97f4a7c15ull;
  const auto random = [&](int64_t below) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<int64_t>((state >> 33) % static_cast<uint64_t>(below));
  };
  const int64_t grid = int64_t{kUnitsPerVoxel} << kGridLevels;
  std::vector<FixedTriangle> triangles(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) {
    const int64_t size = int64_t{64} << i % 10;
    int64_t origin[3];
    for (int64_t& o : origin) o = random(grid);
    for (int v = 0; v < 3; ++v)
      for (int a = 0; a < 3; ++a) {
        const int64_t reach = i % 8 == 0 && a != 0 ? 64 : size;
        triangles[static_cast<size_t>(i)].v[v][a] = (origin[a] + random(reach)) | 1;
      }
  }
  return triangles;
}

struct Result {
  SubDag dag;
  SubDagSummary summary;
};

Result result_of(Backend& backend, const SubvolumeTask& task,
                 std::span<const FixedTriangle> triangles) {
  Result result;
  MemoryStream stream(triangles);
  MemoryBudget budget(kBudgetBytes);
  if (backend.build(task, stream, budget, CancelToken(), result.dag, result.summary) ==
      BuildOutcome::kNeedsSplit)
    result.dag = {};
  return result;
}

bool same(const SubDagSummary& a, const SubDagSummary& b) {
  return a.voxels == b.voxels && a.svo_nodes == b.svo_nodes && a.dag_nodes == b.dag_nodes &&
         a.root_hash == b.root_hash;
}

}  // namespace

std::string difference_from_cpu(Backend& backend) {
  const auto cpu = make_cpu_backend();
  const std::vector<FixedTriangle> triangles = check_triangles(1200);
  for (const uint32_t hash_bits : {64u, 16u, 4u})
    for (const uint32_t level : {0u, 2u}) {
      SubvolumeTask task{kGridLevels, Cube{}, hash_bits};
      task.cube.level = level;
      for (uint32_t& p : task.cube.position) p = (uint32_t{1} << level) / 2;
      const Result expected = result_of(*cpu, task, triangles);
      const Result found = result_of(backend, task, triangles);
      if (found.dag == expected.dag && same(found.summary, expected.summary)) continue;
      return "it built " + std::to_string(found.summary.voxels) + " voxels and " +
             std::to_string(found.summary.dag_nodes) + " nodes where the CPU built " +
             std::to_string(expected.summary.voxels) + " and " +
             std::to_string(expected.summary.dag_nodes) +
             ": expected the same DAG (if the numbers are equal, the nodes differ)";
    }
  return "";
}

}  // namespace voxdag
