// The warnings about the surface of a solid, at the limits between them.
#include "scheduler/solid/solid_report.h"

#include <gtest/gtest.h>

#include <utility>

#include "core/fields/field.h"

namespace voxdag {
namespace {

constexpr uint64_t kRows = 10000;

SolidReport report_of(SolidName rule, uint64_t open_rows, uint64_t odd_rows) {
  SolidReport report;
  report.rule = name_of(rule);
  report.interior = 500000;
  report.rows = kRows;
  report.open_rows = open_rows;
  report.odd_rows = odd_rows;
  report.disputed = 123456;
  return report;
}

// Returns the message of the warning with this code, "none" if there is no warning, or the other
// code.
std::string message(const SolidReport& report, const std::string& code) {
  const auto warning = solid_warning(report, "scene.glb");
  if (!warning) return "none";
  EXPECT_EQ(warning->place, "scene.glb");
  return warning->code == code ? warning->message : warning->code;
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(SolidReportTest, OpenRowsAreIgnoredUpToATenthOfAPercent) {
  EXPECT_EQ(message(report_of(SolidName::kWinding, 10, 10), "solid-open"), "none");
  EXPECT_EQ(message(report_of(SolidName::kParity, 2000, 10), "solid-open"), "none");
  const std::string text = message(report_of(SolidName::kWinding, 11, 11), "solid-open");
  EXPECT_TRUE(contains(text, "not closed (0.11 % of the sample rows)")) << text;
  EXPECT_TRUE(contains(text, "123 456 filled voxels rest on a majority")) << text;
}

// Above 5 % of open rows (parity: odd rows), the warning also says that the input is a scene, and
// names the rule for scenes.
TEST(SolidReportTest, MoreThanFivePercentOfOpenRowsAreAScene) {
  for (const SolidName rule : {SolidName::kWinding, SolidName::kParity}) {
    SCOPED_TRACE(name_of(rule));
    const std::string object = message(report_of(rule, 500, 500), "solid-open");
    EXPECT_TRUE(contains(object, "not closed (5 % of the sample rows)")) << object;
    EXPECT_FALSE(contains(object, "enclosed")) << object;
    const std::string scene = message(report_of(rule, 501, 501), "solid-open");
    EXPECT_TRUE(contains(scene, "more a scene than an object")) << scene;
    EXPECT_TRUE(contains(scene, "123 456 filled voxels rest on a majority")) << scene;
    EXPECT_TRUE(contains(scene, "--solid enclosed")) << scene;
    for (const auto& [rows, percent] : {std::pair(1160, "12 %"), std::pair(10000, "100 %")}) {
      const std::string open = message(report_of(rule, rows, rows), "solid-open");
      EXPECT_TRUE(contains(open, "not closed (" + std::string(percent) + " of")) << open;
    }
  }
}

TEST(SolidReportTest, OpenRowsWithoutOddRowsAreOrientation) {
  const std::string text = message(report_of(SolidName::kWinding, 1, 0), "solid-orientation");
  EXPECT_TRUE(contains(text, "--solid parity")) << text;
  EXPECT_EQ(message(report_of(SolidName::kParity, 9000, 0), "solid-orientation"), "none");
}

TEST(SolidReportTest, ClosedSurfacesWithoutInteriorAreCanceled) {
  SolidReport report = report_of(SolidName::kWinding, 0, 0);
  EXPECT_EQ(message(report, "solid-canceled"), "none");
  report.interior = 0;
  const std::string text = message(report, "solid-canceled");
  EXPECT_TRUE(contains(text, "--solid enclosed")) << text;
  report.rows = 0;  // for example, a scene of points
  EXPECT_EQ(message(report, "solid-canceled"), "none");
}

TEST(SolidReportTest, EnclosedSolidsWithoutInteriorAreReached) {
  SolidReport report = enclosed_report(1000, 1000);
  const std::string text = message(report, "solid-reached");
  EXPECT_TRUE(contains(text, "--radius V")) << text;
  EXPECT_EQ(message(enclosed_report(1001, 1000), "solid-reached"), "none");
}

}  // namespace
}  // namespace voxdag
