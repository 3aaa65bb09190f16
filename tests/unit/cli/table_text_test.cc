#include "cli/service/table_text.h"

#include <gtest/gtest.h>

namespace voxdag::cli {
namespace {

TEST(TableText, AgesAreRoundedDown) {
  const double moment_s = 1'763'708'400;  // 2025-11-21T07:00:00Z
  const auto age = [&](double s) { return age_text("2025-11-21T07:00:00.900Z", moment_s + s); };
  EXPECT_EQ(age(0), "0 s");
  EXPECT_EQ(age(-3600), "0 s") << "the service's clock is ahead";
  EXPECT_EQ(age(59.9), "59 s");
  EXPECT_EQ(age(60), "1 min");
  EXPECT_EQ(age(3599), "59 min");
  EXPECT_EQ(age(3600), "1 h");
  EXPECT_EQ(age(24 * 3600 - 1), "23 h");
  EXPECT_EQ(age(400.0 * 24 * 3600), "400 d");
  EXPECT_EQ(age_text("2025-11-21T07:00:00Z", moment_s), "0 s") << "without fractions";
  for (const char* other : {"", "now", "2025-11-21", "2025-11-21T07:00"})
    EXPECT_EQ(age_text(other, moment_s), "") << other;
}

TEST(TableText, IsCutToTheColumns) {
  EXPECT_EQ(cut_to_columns("name", 4), "name");
  EXPECT_EQ(cut_to_columns("names", 4), "nam\u2026");
  EXPECT_EQ(cut_to_columns("names", 1), "\u2026");
  EXPECT_EQ(cut_to_columns("names", 0), "");
  EXPECT_EQ(cut_to_columns("", 0), "");
  // Accents are one column, also as combining characters. Chinese characters are two columns.
  EXPECT_EQ(cut_to_columns("\u00e9\u00e9\u00e9", 3), "\u00e9\u00e9\u00e9");
  EXPECT_EQ(cut_to_columns("ae\u0301xx", 3), "ae\u0301\u2026");
  EXPECT_EQ(cut_to_columns("\u57ce\u5e02\u57ce", 6), "\u57ce\u5e02\u57ce");
  EXPECT_EQ(cut_to_columns("\u57ce\u5e02\u57ce", 5), "\u57ce\u5e02\u2026");
  EXPECT_EQ(cut_to_columns("\u57ce\u5e02\u57ce", 4), "\u57ce\u2026");
  // Invalid UTF-8 is cut anywhere.
  EXPECT_EQ(cut_to_columns(std::string(100, '\x80'), 200), std::string(100, '\x80'));
}

using Lines = std::vector<std::string>;

TEST(TableText, ColumnsAreAsWideAsTheirCells) {
  EXPECT_EQ(
      table_lines({{"ID", "AGE", "NAME"}, {"17", "3 min", "\u57ce"}, {"4", "", "b"}}, "lrl", 0),
      (Lines{"ID    AGE  NAME", "17  3 min  \u57ce", "4          b"}));
  EXPECT_EQ(table_lines({{"\u57ce", "a", "x"}, {"cc", "b", "y"}}, "lll", 80),
            (Lines{"\u57ce  a  x", "cc  b  y"}));
}

// On a narrow terminal, the name keeps 20 columns if the column before it can be cut.
TEST(TableText, LeavesSpaceForTheName) {
  const std::string name(50, 'n'), state = "build: 32 %, 31.4 s left";
  const std::vector<std::vector<std::string>> rows = {{"id", state, name}};
  EXPECT_EQ(table_lines(rows, "lll", 100), (Lines{"id  " + state + "  " + name}));
  EXPECT_EQ(table_lines(rows, "lll", 50),
            (Lines{"id  " + state + "  " + name.substr(0, 19) + "\u2026"}));
  EXPECT_EQ(table_lines(rows, "lll", 40),
            (Lines{"id  build: 32 %, \u2026  " + name.substr(0, 19) + "\u2026"}));
  EXPECT_EQ(table_lines(rows, "lll", 20), (Lines{"id  build: \u2026  nnnnn\u2026"}));
  EXPECT_EQ(table_lines({{"id", state, "n"}}, "lll", 31), (Lines{"id  " + state + "  n"}));
}

}  // namespace
}  // namespace voxdag::cli
