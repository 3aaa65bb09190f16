// A fixture that reorders small files, and a simple implementation of the order by first parent.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/base/text.h"
#include "core/format/global/open_global.h"
#include "query/reorder/reorder.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/core/format/verify_both_ways.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// The words of each level. Index 0 is the level of the root.
using LevelWords = std::vector<std::vector<uint32_t>>;

// Computes the order by first parent with a depth-first walk of the octree: the nodes of each level
// are in the order in which the walk first reaches them.
class DepthFirstOrder {
 public:
  explicit DepthFirstOrder(const voxdag_reader::File& file)
      : file_(file), levels_(file.brick_level() + 1), places_(levels_.size()) {
    if (!file.empty()) visit(0, 0);
  }
  // Returns the words of all levels in the new order, with new pointers.
  LevelWords levels() const { return levels_; }

 private:
  uint64_t visit(uint32_t level, uint64_t offset) {
    const auto [found, is_new] = places_[level].try_emplace(offset, levels_[level].size());
    const uint64_t place = found->second;
    if (!is_new) return place;
    std::vector<uint32_t>& words = levels_[level];
    if (level == file_.brick_level()) {
      const uint64_t mask = file_.brick(offset);
      words.insert(words.end(), {static_cast<uint32_t>(mask), static_cast<uint32_t>(mask >> 32)});
      return place;
    }
    const voxdag_reader::Node node = file_.node(level, offset);
    const int children = std::popcount(node.child_mask), width = node.wide ? 2 : 1;
    words.push_back(node.child_mask);
    words.resize(words.size() + static_cast<size_t>(children * width));
    for (int i = 0; i < children; ++i) {
      const uint64_t child = visit(level + 1, node.child(i));
      const size_t at = place + 1 + static_cast<size_t>(i * width);
      levels_[level][at] = static_cast<uint32_t>(child);
      if (node.wide) levels_[level][at + 1] = static_cast<uint32_t>(child >> 32);
    }
    return place;
  }

  const voxdag_reader::File& file_;
  LevelWords levels_;
  std::vector<std::map<uint64_t, uint64_t>> places_;  // by level: old offset -> new offset
};

inline LevelWords words_of(const voxdag_reader::File& file) {
  LevelWords levels;
  for (uint32_t l = 0; l <= file.brick_level(); ++l)
    levels.emplace_back(file.level(l).words, file.level(l).words + file.level(l).word_count);
  return levels;
}

class Reorder : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_.file(name); }
  std::string bytes(const std::string& name) const { return read_bytes(path(name)); }

  ReorderSpec spec(NodeOrder order, const std::string& output) const {
    ReorderSpec spec;
    spec.order = order;
    spec.output = path(output);
    spec.memory_bytes = uint64_t{64} << 20;
    spec.replace = true;
    return spec;
  }
  ReorderReport reorder_file(const std::string& input, const ReorderSpec& spec) {
    const auto file = open_global_file(path(input));
    return reorder(*file, spec, system_files(), progress_, never_);
  }
  void verify(const std::string& name, uint64_t narrow_words = global_layout::kNarrowLevelWords,
              bool is_quick = false) {
    verify_both_ways(*open_global_file(path(name)), {2, narrow_words, is_quick});
  }
  // Expects that the folder contains exactly the files with these names.
  void expect_files(std::vector<std::string> names) const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
      found.push_back(entry.path().filename());
    std::sort(found.begin(), found.end());
    std::sort(names.begin(), names.end());
    EXPECT_EQ(found, names);
  }

  TemporaryFolder folder_;
  NoProgress progress_;
  CancelToken never_;
};

}  // namespace voxdag::query
