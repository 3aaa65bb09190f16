// Combines small files, and makes the expected files from the oracle's DAGs of the same voxels.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "query/combine/combine.h"
#include "tests/oracle/dag.h"
#include "tests/unit/core/format/test_files.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

inline constexpr Operation kAllOperations[] = {Operation::kUnion, Operation::kMinus,
                                               Operation::kAnd, Operation::kXor};

class Combine : public testing::Test {
 protected:
  class CollectedWarnings : public NoProgress {
   public:
    void warn(std::string_view message) override { texts.emplace_back(message); }
    std::vector<std::string> texts;
  };

  std::string path(const std::string& name) const { return folder_.file(name); }
  std::string bytes(const std::string& name) const { return read_bytes(path(name)); }

  CombineSpec spec(Operation operation, const std::string& output) const {
    CombineSpec spec;
    spec.operation = operation;
    spec.output = path(output);
    spec.memory_bytes = uint64_t{64} << 20;
    spec.replace = true;
    return spec;
  }

  // Combines the files `a` and `b` of the folder. Verifies the result, and compares its counts with
  // the report.
  CombineReport combine_files(const std::string& a, const std::string& b, const CombineSpec& spec) {
    const auto file_a = open_global_file(path(a)), file_b = open_global_file(path(b));
    const CombineReport report = combine(*file_a, *file_b, spec, system_files(), warnings_, never_);
    const auto written = open_global_file(spec.output);
    MemoryBudget budget(uint64_t{1} << 30);
    verify_global_file(*written, 1, budget, warnings_, never_, spec.narrow_words);
    EXPECT_EQ(report.bytes, written->file_bytes());
    EXPECT_EQ(report.voxels, written->voxels());
    EXPECT_EQ(report.svo_nodes, written->svo_nodes());
    EXPECT_EQ(report.dag_nodes, written->dag_nodes());
    return report;
  }
  // Combines two files, and returns the bytes of the result.
  std::string combined(const std::string& a, Operation operation, const std::string& b,
                       const std::string& output) {
    combine_files(a, b, spec(operation, output));
    return bytes(output);
  }

  // For each level of a file: changes a byte in the middle of the level, and calls check(). At the
  // end, the file is intact again.
  template <class Check>
  void damage_each_level(const std::string& name, const Check& check) const {
    const std::string intact = bytes(name);
    const auto file = open_global_file(path(name));
    for (uint32_t l = 0; l <= file->brick_level(); ++l) {
      SCOPED_TRACE(l);
      std::string damaged = intact;
      const size_t at = file->level(l).file_offset + 4 * (file->level(l).word_count / 2);
      damaged[at] = static_cast<char>(damaged[at] ^ 4);
      write_bytes(path(name), damaged);
      check();
    }
    write_bytes(path(name), intact);
  }
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
  CollectedWarnings warnings_;
  CancelToken never_;
};

// Returns the voxels for which is_set(in_a, in_b) is true. `in_a` tells whether the voxel is set in
// `a`, and `in_b` whether it is set in `b`.
template <class IsSet>
oracle::Voxels voxels_of(const oracle::Voxels& a, const oracle::Voxels& b, const IsSet& is_set) {
  oracle::Voxels voxels(a.edge());
  for (int x = 0; x < a.edge(); ++x)
    for (int y = 0; y < a.edge(); ++y)
      for (int z = 0; z < a.edge(); ++z)
        if (is_set(a.at(x, y, z), b.at(x, y, z))) voxels.set(x, y, z);
  return voxels;
}

inline oracle::Voxels combined_voxels(Operation operation, const oracle::Voxels& a,
                                      const oracle::Voxels& b) {
  return voxels_of(a, b, [operation](bool in_a, bool in_b) {
    switch (operation) {
      case Operation::kUnion:
        return in_a || in_b;
      case Operation::kMinus:
        return in_a && !in_b;
      case Operation::kAnd:
        return in_a && in_b;
      case Operation::kXor:
        break;
    }
    return in_a != in_b;
  });
}

// Sets all voxels of a box.
inline void fill(oracle::Voxels& voxels, const std::array<int, 3>& low,
                 const std::array<int, 3>& high) {
  for (int x = low[0]; x < high[0]; ++x)
    for (int y = low[1]; y < high[1]; ++y)
      for (int z = low[2]; z < high[2]; ++z) voxels.set(x, y, z);
}

}  // namespace voxdag::query
