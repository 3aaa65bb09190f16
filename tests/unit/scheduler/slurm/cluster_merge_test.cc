// Builds on a cluster that run the merge as another job of Slurm, after the tasks. played_slurm.h
// simulates Slurm.
#include <gtest/gtest.h>

#include <fstream>
#include <utility>

#include "core/base/error.h"
#include "scheduler/run_build.h"
#include "tests/support/error_of.h"
#include "tests/unit/scheduler/slurm/played_slurm.h"

namespace voxdag {
namespace {

class ClusterMergeJob : public Cluster {
 protected:
  void SetUp() override {
    Cluster::SetUp();
    slurm_.merge_job = [&] {
      of_job_ = run_build(job_spec(), {system_files(), of_job_log_, never_});
    };
  }
  BuildSpec merging_spec() {
    BuildSpec merging = spec(4);
    merging.run.cluster->merge_job = {
        .arguments = {"build", "x y"}, .folder = "/", .submit_options = {"--mem=1G"}};
    return merging;
  }
  BuildSpec job_spec() {
    BuildSpec job = spec(4);
    job.run.cluster->is_merge_job = true;
    return job;
  }
  Warnings of_job_log_;
  CancelToken never_;
  BuildReport of_job_;
};

TEST_F(ClusterMergeJob, ItsReportIsThatOfTheCommand) {
  slurm_.fates = {"", "FAILED"};  // the merge job submits the failed task again
  const BuildReport report = build(merging_spec());
  EXPECT_EQ(report_json(report), report_json(of_job_));
  EXPECT_EQ(report.cluster->batches, 4u);
  EXPECT_EQ(report.cluster->attempts, 1u);
  EXPECT_NE(of_job_log_.text.find("FAILED; it is submitted again"), std::string::npos);
  const auto submitted = std::ranges::find_if(slurm_.commands, [](const auto& command) {
    return std::ranges::find(command, "--dependency=afterany:1") != command.end();
  });
  ASSERT_NE(submitted, slurm_.commands.end());
  for (const char* word : {"--mem=1G", "--chdir=/"})
    EXPECT_NE(std::ranges::find(*submitted, word), submitted->end()) << word;
  // The same command reuses the result. With --restart or another scene, it builds again.
  slurm_.commands.clear();
  EXPECT_EQ(report_json(build(merging_spec())), report_json(report));
  EXPECT_EQ(count("sbatch"), 2u);  // sbatch --test-only, for the tasks and for the merge job
  BuildSpec restarted = merging_spec();
  restarted.run.restart = true;
  build(restarted);
  EXPECT_EQ(count("sbatch"), 2u + 5);
  write_spheres(scene(), 20000, 2);
  EXPECT_NE(run_build(merging_spec(), context()).sha256, expected_);
}

TEST_F(ClusterMergeJob, ATaskThatSlurmHoldsForEverDoesNotHoldItUp) {
  slurm_.fates = {"", PlayedSlurm::kHeld};
  const auto merge = std::exchange(slurm_.merge_job, nullptr);
  slurm_.merge_job = [&] {
    // Slurm starts the merge job only after the array of tasks has ended. Here this requires
    // scancel, because Slurm holds a task.
    if (count("scancel") > 0)
      merge();
    else
      slurm_.waiting_merge_job = "2";
  };
  slurm_.merge_state = "PENDING|Dependency";
  EXPECT_EQ(build(merging_spec()).cluster->attempts, 1u);
  EXPECT_NE(warnings_.text.find("could not start and holds 1 tasks, such as 1_1: canceled"),
            std::string::npos)
      << warnings_.text;
}

TEST_F(ClusterMergeJob, WhatAPersonHasToDoIsSaid) {
  const auto merge = std::exchange(slurm_.merge_job, nullptr);
  int looks = 0;
  slurm_.merge_state = "PENDING|JobHeldUser";
  slurm_.merge_job = [&] {
    if (++looks < 3)
      slurm_.waiting_merge_job = "2";
    else
      merge();
  };
  build(merging_spec());
  const std::string said = "merge job 2 waits: JobHeldUser\n";
  EXPECT_EQ(warnings_.text.find(said), warnings_.text.rfind(said));
  EXPECT_NE(warnings_.text.find(said), std::string::npos) << warnings_.text;
}

TEST_F(ClusterMergeJob, IfItIsLostTheSameCommandSubmitsItAgain) {
  const auto merge = std::exchange(slurm_.merge_job, nullptr);
  slurm_.merge_end = "CANCELLED Reason=None ExitCode=0:15";
  const Error error = error_of([&] { run_build(merging_spec(), context()); });
  EXPECT_EQ(error.code(), ErrorCode::kIo);
  EXPECT_NE(error.message().find("the job 2 that merges has ended without a result: CANCELLED"),
            std::string::npos)
      << error.message();
  slurm_.merge_job = [&] {
    std::ofstream(output() + ".work/cluster/log-3.txt") << "first\nvoxdag: error: the last line\n";
  };
  slurm_.merge_end = "FAILED Reason=NonZeroExitCode ExitCode=7:0";
  const Error full = error_of([&] { run_build(merging_spec(), context()); });
  EXPECT_EQ(full.code(), ErrorCode::kNoSpace);
  EXPECT_NE(full.message().find("ends with:\nfirst\nvoxdag: error: the last line"),
            std::string::npos)
      << full.message();
  slurm_.merge_job = merge;
  EXPECT_EQ(build(merging_spec()).cluster->batches, 4u);
}

TEST_F(ClusterMergeJob, WhoComesBackFollowsAndWhoStopsTheTasksStopsItFirst) {
  slurm_.merge_job = [&] { cancel_.cancel(); };
  const Error error = error_of([&] { run_build(merging_spec(), context()); });
  EXPECT_EQ(error.code(), ErrorCode::kCanceled);
  EXPECT_NE(error.message().find("job 2 and its tasks run on"), std::string::npos)
      << error.message();
  slurm_.waiting_merge_job = "2";
  slurm_.commands.clear();
  int looks = 0;
  slurm_.merge_job = [&] {
    if (++looks < 3)
      slurm_.waiting_merge_job = "2";
    else
      of_job_ = run_build(job_spec(), {system_files(), of_job_log_, never_});
  };
  const BuildReport report = run_build(merging_spec(), {system_files(), warnings_, never_});
  EXPECT_EQ(report.sha256, expected_);
  EXPECT_EQ(count("sbatch"), 3u);  // the merge job, and two calls of sbatch --test-only
  // The merge job has not canceled itself.
  for (const auto& command : slurm_.commands)
    EXPECT_FALSE(command[0] == "scancel" && command[1].ends_with("-merge"));
}

}  // namespace
}  // namespace voxdag
