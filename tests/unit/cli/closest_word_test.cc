#include "cli/syntax/closest_word.h"

#include <gtest/gtest.h>

namespace voxdag::cli {
namespace {

TEST(ClosestWord, FindsTheMistypedWord) {
  const std::vector<std::string> words = {"build", "build-batch", "plan",   "info",
                                          "view",  "verify",      "version"};
  const std::pair<const char*, const char*> rows[] = {
      {"biuld", "build"},  {"buidl", "build"},
      {"buil", "build"},   {"bulid", "build"},
      {"plna", "plan"},    {"inf", "info"},
      {"verfy", "verify"}, {"vers", "version"},
      {"vie", "view"},     {"frobnicate", ""},
      {"x", ""},           {"", ""},
      {"scene.glb", ""},   {"build-btach", "build-batch"}};
  for (const auto& [typed, expected] : rows)
    EXPECT_EQ(closest_word(typed, words), expected) << typed;
  EXPECT_EQ(closest_word(std::string(1000, 'b'), words), "");
}

TEST(ClosestWord, IgnoresDashesInLengths) {
  const std::vector<std::string> options = {"--color", "--to", "--up"};
  EXPECT_EQ(closest_word("--colur", options), "--color");
  EXPECT_EQ(closest_word("--xy", options), "");
  EXPECT_EQ(suggestion("--colr", options), "; did you mean --color?");
  EXPECT_EQ(suggestion("--frobnicate", options), "");
}

}  // namespace
}  // namespace voxdag::cli
