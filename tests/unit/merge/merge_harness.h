// Divides voxels into subvolumes, merges the artifacts of their sub-DAGs (made by the oracle) into
// a global file, and compares the file with the oracle's DAG of all voxels.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/format/artifact/artifact_writer.h"
#include "core/format/global/global_writer.h"
#include "merge/merge.h"
#include "tests/oracle/core_types.h"
#include "tests/oracle/dag.h"
#include "tests/oracle/scenes.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {

constexpr uint64_t kMiB = uint64_t{1} << 20;

struct MergeOptions {
  uint64_t budget_bytes = uint64_t{1} << 30;
  unsigned threads = 2;
  CancelToken* cancel = nullptr;
  Checkpoint* checkpoint = nullptr;
  Progress* progress = nullptr;
  uint64_t useful_partition_bytes = MergeInputs().useful_partition_bytes;
  double checkpoint_interval_s = 0;  // 0: saves after every level, and waits for each save
};

struct Merged {
  MergeReport report;
  GlobalFileSummary file;
};

// Returns repeating blobs, walls and scattered voxels. `edge` is at least 4.
inline oracle::Voxels mixed_voxels(uint64_t seed, int edge) {
  oracle::Random random(seed);
  oracle::Voxels voxels(edge);
  const int64_t last = edge - 1;
  const auto any = [&] { return static_cast<int>(random.between(0, last)); };
  std::vector<std::array<int, 3>> blob;
  for (int i = 0; i < edge; ++i)
    blob.push_back({any() % std::min(16, edge), any() % std::min(16, edge), any() % 4});
  for (int copy = 0; copy < 12; ++copy) {
    const int step = 4 << random.between(0, 2);
    const int x = any() / step * step, y = any() / step * step, z = any() / step * step;
    for (const auto& p : blob)
      if (x + p[0] < edge && y + p[1] < edge && z + p[2] < edge)
        voxels.set(x + p[0], y + p[1], z + p[2]);
  }
  const int wall = any();
  for (int y = 0; y < edge; ++y)
    for (int z = 0; z < edge / 2; ++z) voxels.set(wall, y, z);
  for (int i = 0; i < 2 * edge; ++i) voxels.set(any(), any(), any());
  return voxels;
}

// Sets each voxel with a probability of 1/2, so that almost no two bricks are equal.
inline oracle::Voxels noise_voxels(uint64_t seed, int edge) {
  std::mt19937_64 random(seed);
  oracle::Voxels voxels(edge);
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z)
        if (random() & 1) voxels.set(x, y, z);
  return voxels;
}

inline oracle::Voxels part_of(const oracle::Voxels& whole, const oracle::Region& region) {
  oracle::Voxels part(region.edge);
  const int x0 = static_cast<int>(region.low[0]), y0 = static_cast<int>(region.low[1]),
            z0 = static_cast<int>(region.low[2]);
  for (int x = 0; x < region.edge; ++x)
    for (int y = 0; y < region.edge; ++y)
      for (int z = 0; z < region.edge; ++z)
        if (whole.at(x0 + x, y0 + y, z0 + z)) part.set(x, y, z);
  return part;
}

// Returns all cubes of a level.
inline std::vector<Cube> equal_cubes(uint32_t level) {
  std::vector<Cube> cubes;
  const uint32_t count = 1u << level;
  for (uint32_t x = 0; x < count; ++x)
    for (uint32_t y = 0; y < count; ++y)
      for (uint32_t z = 0; z < count; ++z) cubes.push_back({level, {x, y, z}});
  return cubes;
}

// Returns randomly chosen cubes of levels 1 to `deepest` that tile the grid.
inline std::vector<Cube> mixed_cubes(uint64_t seed, uint32_t deepest) {
  oracle::Random random(seed);
  std::vector<Cube> waiting{Cube{}}, cubes;
  while (!waiting.empty()) {
    const Cube cube = waiting.back();
    waiting.pop_back();
    if (cube.level == 0 || (cube.level < deepest && random.coin()))
      for (int c = 0; c < 8; ++c) waiting.push_back(cube.child(c));
    else
      cubes.push_back(cube);
  }
  return cubes;
}

class MergeHarness {
 public:
  // A level of more than `narrow_words` words is wide: pointers to its nodes have 64 bits.
  MergeHarness(uint32_t grid_levels, uint32_t hash_bits, uint64_t narrow_words = uint64_t{1} << 32)
      : grid_levels_(grid_levels),
        hash_bits_(hash_bits),
        narrow_words_(narrow_words),
        budget_(uint64_t{1} << 30) {
    grid_.levels = grid_levels;
    segment_ = std::make_unique<SegmentWriter>(system_files(), folder_.path(), 7, budget_);
  }

  const TemporaryFolder& folder() const { return folder_; }
  std::string merged_file() const { return folder_.file("merged.vdag"); }
  std::string segment() const { return segment_path(folder_.path(), 7); }
  std::string scratch_folder() const { return folder_.file("scratch"); }
  bool has_no_scratch() const {
    return !std::filesystem::exists(scratch_folder()) ||
           std::filesystem::is_empty(scratch_folder());
  }
  std::vector<ArtifactRef>& artifacts() { return artifacts_; }

  // Adds an artifact for each cube that contains voxels.
  void add(const oracle::Voxels& voxels, const std::vector<Cube>& cubes) {
    for (const Cube& cube : cubes) {
      const oracle::Region region = oracle::region_of(cube, grid_levels_);
      const oracle::Dag dag =
          oracle::build_dag(part_of(voxels, region), static_cast<int>(hash_bits_));
      if (dag.voxels > 0) add(dag, cube);
    }
  }
  void add(const oracle::Dag& dag, const Cube& cube) {
    ArtifactWriter writer(*segment_, {.grid_levels = grid_levels_, .hash_bits = hash_bits_});
    oracle::send(oracle::as_sub_dag(dag, grid_levels_), writer);
    const ArtifactRoot root{cube, 0, dag.root_hash, dag.voxels, dag.svo_nodes};
    artifacts_.push_back(writer.finish({&root, 1}));
    segment_->flush();
  }

  Merged merge(const MergeOptions& options = {}) {
    MergeInputs inputs;
    inputs.shape = {.grid_levels = grid_levels_, .hash_bits = hash_bits_};
    inputs.artifacts = artifacts_;
    inputs.open_segment = [this](uint32_t id) -> std::shared_ptr<ReadableFile> {
      return system_files().open_read(segment_path(folder_.path(), id));
    };
    inputs.scratch_folder = scratch_folder();
    inputs.useful_partition_bytes = options.useful_partition_bytes;
    inputs.checkpoint_interval_s = options.checkpoint_interval_s;
    MemoryBudget budget(options.budget_bytes);
    GlobalFileWriter out(system_files(), merged_file(), grid_, hash_bits_, narrow_words_);
    NoProgress silent;
    CancelToken never;
    Merged merged;
    merged.report = merge_sub_dags(inputs, system_files(), out, budget, options.threads,
                                   options.progress ? *options.progress : silent,
                                   options.cancel ? *options.cancel : never, options.checkpoint);
    EXPECT_EQ(budget.used(), 0u);
    EXPECT_TRUE(options.checkpoint || has_no_scratch()) << "scratch files were left behind";
    merged.file = out.finish({merged.report.voxels, merged.report.svo_nodes});
    return merged;
  }

  // Writes the global file of a DAG directly, without a merge. The merge must write the same bytes.
  GlobalFileSummary expected(const oracle::Dag& dag) {
    GlobalFileWriter out(system_files(), folder_.file("expected.vdag"), grid_, hash_bits_,
                         narrow_words_);
    std::vector<uint32_t> below, offsets, words;
    bool wide = false;  // pointers to the level below have 64 bits
    uint32_t level = grid_levels_ - 2;
    const auto end_level = [&](size_t nodes) {
      out.begin_level(level--);
      out.checksum_words(words);
      out.write_words(0, words);
      out.end_level({nodes, words.size()});
      below = std::move(offsets);
      wide = words.size() > narrow_words_;
      offsets.clear();
      words.clear();
    };
    for (const uint64_t mask : dag.bricks) {
      offsets.push_back(static_cast<uint32_t>(words.size()));
      words.push_back(static_cast<uint32_t>(mask));
      words.push_back(static_cast<uint32_t>(mask >> 32));
    }
    if (!dag.bricks.empty()) end_level(dag.bricks.size());
    for (const auto& nodes : dag.levels) {
      for (const oracle::Node& node : nodes) {
        offsets.push_back(static_cast<uint32_t>(words.size()));
        words.push_back(node.mask);
        for (const uint32_t child : node.children) {
          words.push_back(below[child]);
          if (wide) words.push_back(0);
        }
      }
      end_level(nodes.size());
    }
    return out.finish({dag.voxels, dag.svo_nodes});
  }

  // Checks that the merged file and the counts match the DAG of all voxels.
  void expect_dag_of(const oracle::Voxels& voxels, const Merged& merged) {
    const oracle::Dag dag = oracle::build_dag(voxels, static_cast<int>(hash_bits_));
    EXPECT_EQ(merged.report.voxels, dag.voxels);
    EXPECT_EQ(merged.report.svo_nodes, dag.svo_nodes);
    EXPECT_EQ(merged.report.dag_nodes, dag.dag_nodes);
    EXPECT_EQ(merged.file.sha256, expected(dag).sha256);
  }

 private:
  const uint32_t grid_levels_, hash_bits_;
  const uint64_t narrow_words_;
  TemporaryFolder folder_;
  MemoryBudget budget_;
  Grid grid_;
  std::unique_ptr<SegmentWriter> segment_;
  std::vector<ArtifactRef> artifacts_;
};

}  // namespace voxdag
