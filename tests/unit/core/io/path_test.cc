#include <gtest/gtest.h>

#include "core/io/file_system.h"

namespace voxdag {
namespace {

// parent_directory() gives the same results as dirname(1).
TEST(ParentDirectory, IsThatOfDirname) {
  const struct {
    const char *path, *parent;
  } rows[] = {{"", "."},     {"a", "."},     {"a/", "."},    {"a/b", "a"},
              {"a/b/", "a"}, {"a//b", "a"},  {"/", "/"},     {"//", "/"},
              {"/a", "/"},   {"/a/", "/"},   {"/a/b", "/a"}, {"/a//b//", "/a"},
              {"./a", "."},  {"../a", ".."}, {".", "."},     {"a b/c d", "a b"}};
  for (const auto& row : rows) EXPECT_EQ(parent_directory(row.path), row.parent) << row.path;
}

}  // namespace
}  // namespace voxdag
