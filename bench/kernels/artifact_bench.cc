// Measures the speed of writing a sub-DAG to a segment file as an artifact, and of reading it back,
// in rows (bricks and nodes) per second.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <random>
#include <string>

#include "core/backend/backend.h"
#include "core/backend/memory_stream.h"
#include "core/format/artifact/artifact_reader.h"
#include "core/format/artifact/artifact_writer.h"

namespace voxdag {
namespace {

constexpr uint32_t kLevels = 11;

// The sub-DAG of random triangles with an extent of about 30 voxels, like the triangles of a scan.
struct Sample {
  MemoryBudget budget{uint64_t{4} << 30};
  SubDag dag;
  SubDagSummary summary;

  Sample() {
    std::mt19937_64 random(3);
    const auto below = [&](int64_t end) { return static_cast<int64_t>(random() % end) | 1; };
    std::vector<FixedTriangle> triangles(40'000);
    for (FixedTriangle& t : triangles)
      for (int a = 0; a < 3; ++a) {
        t.v[0][a] = below((int64_t{1} << kLevels) * kUnitsPerVoxel);
        for (int i = 1; i < 3; ++i) t.v[i][a] = t.v[0][a] + 2 * (below(4096) - 2048);
      }
    MemoryStream stream(triangles);
    make_cpu_backend()->build({kLevels, Cube{}, 64}, stream, budget, CancelToken(), dag, summary);
  }
};
Sample& sample() {
  static Sample sample;
  return sample;
}

class Folder {
 public:
  ~Folder() { std::filesystem::remove_all(path_); }
  const std::string& path() const { return path_; }

 private:
  const std::string path_ =
      make_temporary_folder(std::filesystem::temp_directory_path() / "voxdag-bench-");
};

ArtifactRef write(const std::string& folder) {
  Sample& made = sample();
  SegmentWriter segment(system_files(), folder, 0, made.budget);
  ArtifactWriter artifact(segment, {.grid_levels = kLevels});
  artifact.bricks({made.dag.brick_masks});
  for (const SubDag::Nodes& level : made.dag.levels) artifact.nodes(level.view());
  const ArtifactRoot root{Cube{}, 0, made.summary.root_hash, made.summary.voxels,
                          made.summary.svo_nodes};
  const ArtifactRef ref = artifact.finish({&root, 1});
  segment.flush();
  return ref;
}

void report(benchmark::State& state, const ArtifactRef& ref) {
  const uint64_t rows = sample().summary.dag_nodes;
  state.SetItemsProcessed(static_cast<int64_t>(state.iterations() * rows));
  state.counters["bytes/row"] = static_cast<double>(ref.bytes) / static_cast<double>(rows);
}

void write_artifact(benchmark::State& state) {
  const Folder folder;
  ArtifactRef ref;
  for (auto _ : state) ref = write(folder.path());
  report(state, ref);
}

void read_artifact(benchmark::State& state) {
  const Folder folder;
  const ArtifactRef ref = write(folder.path());
  Frame frame;
  for (auto _ : state) {
    const ArtifactReader reader(system_files().open_read(segment_path(folder.path(), 0)), ref);
    for (const ArtifactLevel& level : reader.levels())
      for (size_t i = 0; i < level.frames.size(); ++i) reader.read_frame(level.level, i, frame);
  }
  report(state, ref);
}

BENCHMARK(write_artifact)->Unit(benchmark::kMillisecond);
BENCHMARK(read_artifact)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace voxdag
