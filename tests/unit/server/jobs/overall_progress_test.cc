#include "server/jobs/overall_progress.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "server/jobs/live_job.h"

namespace voxdag::server {
namespace {

const std::vector<StageShare> kShares = {{"ingest", 10}, {"build", 60}, {"merge", 30}};

StageProgress stage(const char* name, uint64_t done, uint64_t total, double wall_s, bool ended) {
  StageProgress progress;
  progress.name = name;
  progress.done = done;
  progress.total = total;
  progress.wall_s = wall_s;
  progress.ended = ended;
  return progress;
}

std::string names_of(const GeometryOptions& options) {
  std::string names;
  for (const StageShare& share : long_stages(options)) names += std::string(share.stage) + " ";
  return names;
}

TEST(OverallProgress, HasTheStagesOfTheOptions) {
  GeometryOptions options;
  EXPECT_EQ(names_of(options), "ingest build merge write ");
  options.solid = SolidName::kWinding;
  options.order = OrderName::kFirstParent;
  EXPECT_EQ(names_of(options), "ingest rows build merge reorder write ");
  options.solid = SolidName::kEnclosed;
  options.attributes = AttributeSet{Attribute::kNormal};
  EXPECT_EQ(names_of(options), "ingest build enclose merge reorder color write ");
}

TEST(OverallProgress, WeightsTheStages) {
  EXPECT_EQ(overall_progress({}, kShares).fraction, 0);
  EXPECT_EQ(overall_progress({}, kShares).eta_s, std::nullopt);
  std::vector<StageProgress> begun = {stage("scan", 5, 5, 3, true), stage("ingest", 5, 5, 2, true)};
  EXPECT_DOUBLE_EQ(overall_progress(begun, kShares).fraction, 0.1);
  // `scan` and `ingest` took 5 s. They are 10 of the 100 shares of the work, and 90 shares are
  // left.
  EXPECT_DOUBLE_EQ(overall_progress(begun, kShares).eta_s.value(), 45);

  begun.push_back(stage("partition", 1, 4, 5, false));
  EXPECT_DOUBLE_EQ(overall_progress(begun, kShares).fraction, 0.1) << "a short stage";
  begun.back().ended = true;
  begun.push_back(stage("build", 16, 64, 15, false));
  EXPECT_DOUBLE_EQ(overall_progress(begun, kShares).fraction, 0.25);
  // At the rate of its first quarter, the rest of the stage `build` takes 45 s. So far, 25 shares
  // took 25 s, so the 30 shares of `merge` take 30 s.
  EXPECT_DOUBLE_EQ(overall_progress(begun, kShares).eta_s.value(), 45 + 30);

  begun.push_back(stage("merge", 0, 0, 1, false));
  EXPECT_DOUBLE_EQ(overall_progress(begun, kShares).fraction, 0.7);
  EXPECT_EQ(overall_progress(begun, kShares).eta_s, std::nullopt) << "unknown total";
  begun.back() = stage("merge", 9, 7, 1, true);
  EXPECT_DOUBLE_EQ(overall_progress(begun, kShares).fraction, 1);
  EXPECT_DOUBLE_EQ(overall_progress(begun, kShares).eta_s.value(), 0);
}

// Work of earlier attempts counts for the fraction, but not for the speed of this attempt.
TEST(OverallProgress, TakesTheSpeedFromThisAttempt) {
  std::vector<StageProgress> begun = {stage("build", 60, 100, 12, false)};
  begun[0].resumed_at = 50;
  const OverallProgress progress = overall_progress(begun, kShares);
  EXPECT_DOUBLE_EQ(progress.fraction, 0.1 + 0.36);
  // In this attempt, 10 of 100 units took 12 s, so the other 40 units take 48 s. These 10 units are
  // 6 of the 60 shares of `build`, so the 30 shares of `merge` take 60 s.
  EXPECT_DOUBLE_EQ(progress.eta_s.value(), 48 + 60);
  begun[0].done = 50;
  EXPECT_EQ(overall_progress(begun, kShares).eta_s, std::nullopt);
}

// The fraction of a running job never decreases, and is 1 once the job has a result.
TEST(OverallProgress, OfAJobNeverDecreases) {
  LiveJob live(0, kShares);
  const auto overall = [&] { return nlohmann::json::parse(live.progress_json())["overall"]; };
  live.apply(StageBegun{"build", "subvolumes", 4});
  live.apply(StageAdvanced{2, 4});
  EXPECT_EQ(overall()["fraction"], 0.4);
  live.apply(StageAdvanced{2, 8});  // subvolumes were split
  EXPECT_EQ(overall()["fraction"], 0.4);
  live.apply(StageAdvanced{6, 8});
  EXPECT_EQ(overall()["fraction"], 0.55);
  EXPECT_TRUE(overall()["eta_s"].is_null()) << "after less than a second";
  live.apply(Result{"{}"});
  EXPECT_EQ(overall(), nlohmann::json({{"fraction", 1.0}, {"eta_s", 0.0}}));
}

}  // namespace
}  // namespace voxdag::server
