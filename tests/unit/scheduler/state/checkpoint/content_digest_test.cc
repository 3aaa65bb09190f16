#include "scheduler/state/checkpoint/content_digest.h"

#include <gtest/gtest.h>

#include <set>

namespace voxdag {
namespace {

// The digest depends on the grid, and on the pieces of the scene and their order. A copy of a
// digest can be continued independently of the original.
TEST(ContentDigest, TellsContentsApart) {
  const Checksum128 a{1, 2}, b{3, 4};
  std::set<std::string> all;
  for (const Grid& grid : {Grid{10, {1.5, -2, 0.25}, 7.5}, Grid{9, {1.5, -2, 0.25}, 7.5},
                           Grid{10, {1.5, -2, 0}, 7.5}, Grid{10, {1.5, -2, 0.25}, 7}}) {
    ContentDigest digest(grid);
    all.insert(digest.hex());
    digest.add(a);
    all.insert(digest.hex());
    const ContentDigest copy = digest;
    digest.add(b);
    all.insert(digest.hex());
    ContentDigest again = copy;
    again.add(b);
    EXPECT_EQ(again.hex(), digest.hex());
    EXPECT_EQ(digest.hex().size(), 32u);
    ContentDigest reversed(grid);
    reversed.add(b);
    reversed.add(a);
    all.insert(reversed.hex());
  }
  EXPECT_EQ(all.size(), 16u);
}

}  // namespace
}  // namespace voxdag
