#include "core/base/warning.h"

#include <gtest/gtest.h>

namespace voxdag {
namespace {

TEST(Warning, TextHasPlaceAndCount) {
  EXPECT_EQ((Warning{"a", "x.glb: mesh 1", "is odd"}.text()), "x.glb: mesh 1: is odd");
  EXPECT_EQ((Warning{"a", "x.glb", "is odd", 3}.text()), "x.glb: is odd (3 times)");
  EXPECT_EQ((Warning{"a", "", "is odd"}.text()), "is odd");
}

TEST(WarningList, CountsEqualWarnings) {
  WarningList list;
  list.add({"a", "one", "is odd"});
  list.add({"b", "two", "is odd"});
  list.add({"a", "three", "is odd", 4});
  list.add({"a", "four", "is even"});
  const std::vector<Warning> expected = {
      {"a", "one", "is odd", 5}, {"b", "two", "is odd"}, {"a", "four", "is even"}};
  EXPECT_EQ(list.list(), expected);
}

// The list has a limited length, however many different faults a file has.
TEST(WarningList, IsLimited) {
  WarningList list;
  for (int i = 0; i < 1000; ++i) list.add({"a", "place", "fault " + std::to_string(i), 2});
  ASSERT_EQ(list.list().size(), WarningList::kMaxWarnings);
  EXPECT_EQ(list.list().back().code, "further-warnings");
  EXPECT_EQ(list.list().back().count, 2 * (1000 - (WarningList::kMaxWarnings - 1)));
}

}  // namespace
}  // namespace voxdag
