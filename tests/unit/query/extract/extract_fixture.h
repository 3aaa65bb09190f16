// Extracts parts of small files. Also makes the expected files from the oracle's DAGs of the same
// voxels.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "query/extract/extract.h"
#include "tests/oracle/dag.h"
#include "tests/unit/core/format/test_files.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// Collects the texts of warnings.
class Warnings : public NoProgress {
 public:
  void warn(std::string_view message) override { texts.emplace_back(message); }
  std::vector<std::string> texts;
};

// Returns the cells of the grid of 2^levels cells per edge that contain a voxel.
inline oracle::Voxels coarser(const oracle::Voxels& voxels, uint32_t levels) {
  oracle::Voxels cells(1 << levels);
  const int size = voxels.edge() >> levels;
  for (int x = 0; x < voxels.edge(); ++x)
    for (int y = 0; y < voxels.edge(); ++y)
      for (int z = 0; z < voxels.edge(); ++z)
        if (voxels.at(x, y, z)) cells.set(x / size, y / size, z / size);
  return cells;
}

// Returns the voxels in `region`, in a grid of `edge` voxels per edge whose low corner is `low`.
inline oracle::Voxels part_of(const oracle::Voxels& voxels, const Region& region,
                              const std::array<int64_t, 3>& low, int edge) {
  oracle::Voxels part(edge);
  for (int64_t x = region.low[0]; x < region.high[0]; ++x)
    for (int64_t y = region.low[1]; y < region.high[1]; ++y)
      for (int64_t z = region.low[2]; z < region.high[2]; ++z)
        if (voxels.at(static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)))
          part.set(static_cast<int>(x - low[0]), static_cast<int>(y - low[1]),
                   static_cast<int>(z - low[2]));
  return part;
}

class Extract : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_.file(name); }

  ExtractSpec spec(const std::string& output, const Selection& selection, bool crop = false) const {
    ExtractSpec spec;
    spec.selection = selection;
    spec.crop = crop;
    spec.output = path(output);
    spec.memory_bytes = uint64_t{64} << 20;
    spec.threads = 2;
    spec.replace = true;
    return spec;
  }

  // Extracts from a file of the folder, and verifies the written file.
  ExtractReport extract_file(const std::string& input, const ExtractSpec& spec) {
    const auto file = open_global_file(path(input));
    const ExtractReport report = extract(*file, spec, system_files(), warnings_, never_);
    const auto written = open_global_file(spec.output);
    MemoryBudget budget(uint64_t{1} << 30);
    verify_global_file(*written, 2, budget, warnings_, never_, spec.narrow_words);
    EXPECT_EQ(report.bytes, written->file_bytes());
    EXPECT_EQ(report.voxels, written->voxels());
    EXPECT_EQ(report.svo_nodes, written->svo_nodes());
    EXPECT_EQ(report.dag_nodes, written->dag_nodes());
    return report;
  }
  std::string bytes(const std::string& name) const { return read_bytes(path(name)); }

  // Checks that the folder contains exactly these files.
  void expect_files(std::vector<std::string> names) const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
      found.push_back(entry.path().filename());
    std::sort(found.begin(), found.end());
    std::sort(names.begin(), names.end());
    EXPECT_EQ(found, names);
  }

  TemporaryFolder folder_;
  Warnings warnings_;
  CancelToken never_;
};

}  // namespace voxdag::query
