// Builds on a cluster. Each Slurm task builds a batch: some of the subvolumes. The test simulates
// Slurm (played_slurm.h).
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/base/error.h"
#include "scheduler/run_build.h"
#include "scheduler/slurm/batches.h"
#include "scheduler/slurm/files/batch_file.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/slurm/run_batch.h"
#include "scheduler/stages/plan/cluster_plan.h"
#include "tests/support/error_of.h"
#include "tests/unit/scheduler/slurm/played_slurm.h"

namespace voxdag {
namespace {

TEST_F(Cluster, SameBytesFromAnyNumberOfTasks) {
  for (const uint64_t tasks : {1, 2, 7, 30}) {
    SCOPED_TRACE(tasks);
    const BuildReport report = build(spec(tasks));
    ASSERT_TRUE(report.cluster);
    EXPECT_EQ(report.cluster->batches, tasks);
    EXPECT_EQ(report.cluster->attempts, 0u);
    EXPECT_LT(report.cluster->rows_after, report.cluster->rows_before);
    EXPECT_EQ(warnings_.text, "");
  }
}

// With --thin, triangles without area set no voxels, so a subvolume with triangles can be empty.
// Builds on the cluster give the bytes of a local build.
TEST_F(Cluster, SameBytesOfThinBuildsWithEmptySubvolumes) {
  std::ofstream specks(folder_.file("specks.obj"));
  specks << "v 0 0 0\nv 1000 1000 0\nv 0 1000 1000\nf 1 2 3\n";
  for (int i = 0; i < 200; ++i) {
    const auto vertex = [&](double shift) {
      specks << "v " << 37 * i % 997 + shift << ' ' << 71 * i % 991 << ' ' << 113 * i % 983 << '\n';
    };
    for (const double shift : {0.0, 0.01, 0.02}) vertex(shift);
    specks << "f -1 -2 -3\n";
  }
  specks.close();
  const auto thin = [&](BuildSpec build_spec) {
    build_spec.geometry.scenes = {folder_.file("specks.obj")};
    build_spec.geometry.thin = true;
    return build_spec;
  };
  expected_ = run_build(thin(local_spec()), context()).sha256;
  for (const uint64_t tasks : {1, 40}) {
    SCOPED_TRACE(tasks);
    EXPECT_EQ(build(thin(spec(tasks))).cluster->attempts, 0u);
    EXPECT_EQ(warnings_.text, "");
  }
}

TEST_F(Cluster, FailedTasksAreSubmittedAgainWithSlurmsReason) {
  slurm_.fates = {"", "OUT_OF_MEMORY", "NODE_FAIL", "", "PREEMPTED"};
  const BuildReport report = build(spec(4));
  EXPECT_EQ(report.cluster->batches, 4u);
  EXPECT_EQ(report.cluster->attempts, 3u);
  EXPECT_NE(warnings_.text.find("batch 1, task 1_1 on n7: OUT_OF_MEMORY; it is submitted again"),
            std::string::npos)
      << warnings_.text;
  EXPECT_NE(warnings_.text.find("NODE_FAIL"), std::string::npos);
  EXPECT_NE(warnings_.text.find("PREEMPTED"), std::string::npos);
}

TEST_F(Cluster, ATaskThatSlurmHoldsForEverIsSubmittedAgain) {
  slurm_.fates = {"", PlayedSlurm::kHeld, PlayedSlurm::kHeld};
  const BuildReport report = build(spec(3));
  EXPECT_EQ(report.cluster->attempts, 2u);
  EXPECT_NE(warnings_.text.find("batch 1, task 1_1: CANCELLED: Slurm could not start it (launch "
                                "failed requeued held); it is submitted again"),
            std::string::npos)
      << warnings_.text;
}

TEST_F(Cluster, ABatchThatIsOutOfTimeIsSplit) {
  slurm_.fates = {"TIMEOUT", "", "TIMEOUT"};
  const BuildReport report = build(spec(2));
  EXPECT_EQ(report.cluster->batches, 4u);
  EXPECT_EQ(report.cluster->attempts, 2u);
  EXPECT_NE(warnings_.text.find("TIMEOUT; it is split and submitted again"), std::string::npos);
}

TEST_F(Cluster, ABatchOfOneSubvolumeIsSplitInItsParts) {
  BuildSpec one = spec(1);
  one.run.subvolume_edge = 4096;  // one subvolume: the complete grid
  slurm_.fates = {"TIMEOUT"};
  const BuildReport report = build(one);
  EXPECT_EQ(report.cluster->batches, 2u);
  EXPECT_GT(report.subvolumes, 1u);
}

TEST_F(Cluster, TooManyFailuresEndTheBuildAndTheNextRunGoesOn) {
  BuildSpec hasty = spec(3);
  hasty.run.cluster->max_retries = 1;
  slurm_.fates = {"", "FAILED", "", "FAILED"};
  const Error error = error_of([&] { run_build(hasty, context()); });
  EXPECT_EQ(error.code(), ErrorCode::kLimit);
  EXPECT_NE(error.message().find("batch 1, task 2_1 on n7: FAILED; it has failed 2 times"),
            std::string::npos)
      << error.message();
  // Only batch 1 is built again; the other two batches are reused.
  slurm_.commands.clear();
  const BuildReport report = build(hasty);
  EXPECT_EQ(report.cluster->batches, 3u);
  for (const auto& command : slurm_.commands) {
    if (command[0] == "sbatch" && command[1] != "--test-only") {
      EXPECT_NE(std::ranges::find(command, "--array=3"), command.end());
    }
  }
}

TEST_F(Cluster, ManyBatchesTakeSeveralArrays) {
  slurm_.max_array_size = 10;
  build(spec(25));
  EXPECT_EQ(count("sbatch"), 1u + 3);  // sbatch --test-only, and three arrays
}

TEST_F(Cluster, WaitsForASlurmThatDoesNotAnswer) {
  slurm_.fates = {"FAILED"};
  slurm_.squeue_failures = 5;
  build(spec(1));
  EXPECT_NE(warnings_.text.find("Slurm does not answer (squeue): waiting for it"),
            std::string::npos);
}

TEST_F(Cluster, ARefusalNamesSlurmsReason) {
  slurm_.refusal = "sbatch: error: invalid partition specified: nowhere";
  const Error error = error_of([&] { run_build(spec(1), context()); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
  EXPECT_NE(error.message().find("invalid partition specified: nowhere"), std::string::npos);
}

TEST_F(Cluster, BadOptionsAreRefusedBeforeTheSceneIsRead) {
  slurm_.test_refusal = "allocation failure: Invalid partition name specified";
  EXPECT_NE(error_of([&] { run_build(spec(1), context()); }).message().find("Invalid partition"),
            std::string::npos);
  slurm_.test_refusal = "";
  for (const char* option : {"--array=0-9", "-a 3", "-Jmine", "--job-name=mine", "--comment x"}) {
    SCOPED_TRACE(option);
    BuildSpec refused = spec(1);
    refused.run.cluster->submit_options = option;
    const Error error = error_of([&] { run_build(refused, context()); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("is set by voxdag"), std::string::npos) << error.message();
  }
  for (const char* option :
       {"script.sh", "--mem=8G script.sh", "-n1 script.sh", "-n 1 script.sh"}) {
    SCOPED_TRACE(option);
    BuildSpec refused = spec(1);
    refused.run.cluster->submit_options = option;
    EXPECT_NE(error_of([&] { run_build(refused, context()); }).message().find("'script.sh'"),
              std::string::npos);
  }
  EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
}

TEST_F(Cluster, WaitsForASlurmThatTakesNoTasksNow) {
  slurm_.refusal = "Batch job submission failed: Unable to contact slurm controller";
  slurm_.refusals = 3;
  build(spec(2));
  EXPECT_NE(warnings_.text.find("Slurm accepts no tasks now"), std::string::npos) << warnings_.text;
}

// A Slurm that has just been started knows no nodes, and refuses tasks that it accepts some seconds
// later. The build tries again until slurm_start_s has passed.
TEST_F(Cluster, WaitsForASlurmThatHasJustBeenStarted) {
  slurm_.test_refusal = "allocation failure: Requested node configuration is not available";
  slurm_.refusal = "Batch job submission failed: Requested node configuration is not available";
  slurm_.test_refusals = slurm_.refusals = 3;
  build(spec(2));
  EXPECT_NE(warnings_.text.find("Slurm has no nodes for the tasks (allocation failure"),
            std::string::npos)
      << warnings_.text;
  EXPECT_NE(warnings_.text.find("Slurm accepts no tasks now"), std::string::npos);
  for (int* refusals : {&slurm_.test_refusals, &slurm_.refusals}) {
    *refusals = INT_MAX;
    BuildSpec never = spec(2);
    never.run.cluster->slurm_start_s = 0.05;
    const Error error = error_of([&] { run_build(never, context()); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("Requested node configuration"), std::string::npos);
    *refusals = 0;
  }
}

TEST_F(Cluster, AnArrayThatIsTooLargeForSlurmIsHalved) {
  slurm_.max_tasks = 3;
  EXPECT_EQ(build(spec(12)).cluster->batches, 12u);
  EXPECT_NE(warnings_.text.find("QOSMaxSubmitJobPerUserLimit"), std::string::npos);
}

// If cluster.json is lost or of another version of voxdag, the build still reuses subvolumes that
// are built. New segments get unused numbers, because rows of the job store refer to the existing
// segments.
TEST_F(Cluster, ALostStateCostsNothingThatIsBuilt) {
  for (const bool is_lost : {true, false}) {
    SCOPED_TRACE(is_lost);
    BuildSpec four = spec(4);
    four.run.cluster->max_retries = 0;
    slurm_.fates = {"", "", "FAILED", ""};
    EXPECT_EQ(error_of([&] { run_build(four, context()); }).code(), ErrorCode::kLimit);
    const std::string state = output() + ".work/cluster/cluster.json";
    if (is_lost) {
      std::filesystem::remove(state);
    } else {
      four.run.cluster->program_version = slurm_.program = "1.2.4";
    }
    const BuildReport report = build(four);
    EXPECT_GT(report.subvolumes_reused, 0u);
    slurm_.program = kVersion;
  }
}

// A build does not use the batches of a different plan of the same scene, even if their files are
// in its cluster folder.
TEST_F(Cluster, BatchesOfAnotherPlanAreNotTakenOver) {
  BuildSpec fine = spec(4);
  fine.run.cluster->max_retries = 0;
  slurm_.fates = {"", "", "FAILED", ""};
  EXPECT_EQ(error_of([&] { run_build(fine, context()); }).code(), ErrorCode::kLimit);
  const std::string cluster = output() + ".work/cluster";
  const std::string copy = folder_.file("copy");
  std::filesystem::copy(cluster, copy, std::filesystem::copy_options::recursive);
  BuildSpec coarse = spec(2);
  coarse.run.subvolume_edge = 256;
  coarse.run.restart = true;
  coarse.run.cluster->max_retries = 0;
  slurm_.fates = {"FAILED", "FAILED"};
  EXPECT_EQ(error_of([&] { run_build(coarse, context()); }).code(), ErrorCode::kLimit);
  std::filesystem::remove_all(cluster);
  std::filesystem::copy(copy, cluster, std::filesystem::copy_options::recursive);
  coarse.run.restart = false;
  build(coarse);
}

TEST_F(Cluster, ARestartOnThisMachineStopsTheTasks) {
  BuildSpec four = spec(4);
  four.run.cluster->max_retries = 0;
  slurm_.fates = {"", "", "FAILED", ""};
  EXPECT_EQ(error_of([&] { run_build(four, context()); }).code(), ErrorCode::kLimit);
  BuildSpec again = spec(4);
  again.run.restart = true;
  slurm_.commands.clear();
  build(again);
  EXPECT_GE(count("scancel"), 1u);
}

TEST_F(Cluster, ThisMachineTakesOverWhatTasksHaveBuilt) {
  BuildSpec four = spec(4);
  four.run.cluster->max_retries = 0;
  slurm_.fates = {"", "", "FAILED", ""};
  EXPECT_EQ(error_of([&] { run_build(four, context()); }).code(), ErrorCode::kLimit);
  BuildSpec local = local_spec();
  local.run.subvolume_edge = 64;
  const BuildReport report = run_build(local, context());
  EXPECT_EQ(report.sha256, expected_);
  EXPECT_GT(report.subvolumes_reused, 0u);
  EXPECT_FALSE(report.cluster);
  EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
}

// If the file with the triangles of a batch is damaged, the build fails, and the next run writes
// this file again.
TEST_F(Cluster, ADamagedBatchIsCutAgain) {
  BuildSpec hasty = spec(2);
  hasty.run.cluster->max_retries = 1;
  slurm_.before_task = [&](uint32_t batch) {
    if (batch == 0)
      std::ofstream(output() + ".work/cluster/batch-0.vdbatch") << "vdbatch3 and no more";
  };
  const Error error = error_of([&] { run_build(hasty, context()); });
  EXPECT_NE(error.message().find("batch-0.vdbatch"), std::string::npos) << error.message();
  EXPECT_GT(build(hasty).subvolumes_reused, 0u);
}

// A task reaches its time limit after the build was canceled. The next run of the same command
// finds the timeout, and splits the batch.
TEST_F(Cluster, ATimeoutIsNoticedByTheNextRun) {
  BuildSpec two = spec(2);
  slurm_.fates = {"", "TIMEOUT"};
  slurm_.before_task = [&](uint32_t batch) {
    if (batch == 1) cancel_.cancel();
  };
  EXPECT_EQ(error_of([&] { run_build(two, context()); }).code(), ErrorCode::kCanceled);
  slurm_.before_task = nullptr;
  CancelToken never;
  const BuildReport report = run_build(two, {system_files(), warnings_, never});
  EXPECT_EQ(report.sha256, expected_);
  EXPECT_EQ(report.cluster->attempts, 1u);
  EXPECT_NE(warnings_.text.find("TIMEOUT; it is split"), std::string::npos) << warnings_.text;
}

// A batch is split after a timeout. Timeouts and preemptions do not count as failures, so they do
// not use up max_retries.
TEST_F(Cluster, SplitsDoNotUseUpTheRetries) {
  BuildSpec strict = spec(1);
  strict.run.cluster->max_retries = 0;
  slurm_.fates = {"TIMEOUT", "TIMEOUT", "TIMEOUT", "TIMEOUT", "PREEMPTED"};
  EXPECT_EQ(build(strict).cluster->attempts, 5u);
}

TEST_F(Cluster, LeftoversThatCannotBeRemovedDoNotStopABuild) {
  const std::string folder = output() + ".work/cluster/attempt-77-abc";
  slurm_.before_task = [&](uint32_t) {
    std::filesystem::create_directories(folder);
    std::ofstream(folder + "/.nfs0001") << "open elsewhere";
  };
  const BuildReport report = run_build(spec(2), context());
  EXPECT_EQ(report.sha256, expected_);
}

// The next task removes the temporary folder that a killed task has left. It keeps the folder of a
// running task, which is locked, and a folder that other users can write.
TEST_F(Cluster, TemporaryFoldersOfKilledTasksAreRemoved) {
  const std::string killed = folder_.file("tmp/voxdag-batch-killed");
  const std::string running = folder_.file("tmp/voxdag-batch-running");
  const std::string shared = folder_.file("tmp/voxdag-batch-shared");
  for (const std::string& path : {killed, running, shared}) {
    std::filesystem::create_directories(path);
    std::ofstream(path + "/lock");
    std::ofstream(path + "/segment-0.vdseg") << "something";
    std::filesystem::permissions(
        path, path == shared ? std::filesystem::perms::all : std::filesystem::perms::owner_all);
  }
  const auto lock = system_files().try_lock(running + "/lock");
  slurm_.temporary_folder = folder_.file("tmp");
  build(spec(1));
  EXPECT_FALSE(std::filesystem::exists(killed));
  EXPECT_TRUE(std::filesystem::exists(running + "/segment-0.vdseg"));
  EXPECT_TRUE(std::filesystem::exists(shared)) << "others may have put it there";
}

TEST_F(Cluster, PercentSignsInPathsAreNotForSlurm) {
  std::filesystem::create_directories(folder_.file("a%xb"));
  BuildSpec odd = spec(1);
  odd.run.output = folder_.file("a%xb/out.vdag");
  EXPECT_EQ(run_build(odd, context()).sha256, expected_);
  bool is_found = false;
  for (const auto& command : slurm_.commands)
    for (const std::string& word : command)
      is_found =
          is_found || word.find("a%%xb/out.vdag.work/cluster/log-%A_%a") != std::string::npos;
  EXPECT_TRUE(is_found);
}

TEST(ClusterParts, CommandsGetNoVariablesOfTheJobAroundThem) {
  for (const char* hidden :
       {"SLURM_MEM_PER_NODE=1500", "SLURM_JOB_ID=7", "SQUEUE_STATES=RUNNING", "SBATCH_WAIT=1"})
    EXPECT_TRUE(is_hidden_variable(hidden)) << hidden;
  for (const char* shown : {"PATH=/bin", "SLURM_CONF=/etc/slurm.conf", "SBATCH_PARTITION=x"})
    EXPECT_FALSE(is_hidden_variable(shown)) << shown;
}

TEST_F(Cluster, AnotherVersionOnANodeIsRefusedByName) {
  BuildSpec mixed = spec(2);
  mixed.run.cluster->max_retries = 0;
  slurm_.program = "1.2.4";
  const Error error = error_of([&] { run_build(mixed, context()); });
  EXPECT_NE(error.message().find("voxdag 1.2.4"), std::string::npos) << error.message();
  EXPECT_NE(error.message().find("of voxdag 1.2.3"), std::string::npos);
  slurm_.program = kVersion;
  build(mixed);
}

TEST_F(Cluster, DamagedBatchesAndRecordsDoNotCount) {
  const std::string cluster = output() + ".work/cluster";
  bool was_damaged = false;
  slurm_.before_task = [&](uint32_t batch) {
    if (batch != 1 || std::exchange(was_damaged, true)) return;
    std::ofstream(cluster + "/batch-1.record-+torn.json") << "{\"program\": \"1.2.3\", \"bu";
    std::ofstream(cluster + "/batch-0.record-+empty.json");
  };
  const BuildReport report = build(spec(2));
  EXPECT_EQ(report.cluster->batches, 2u);
  EXPECT_NE(warnings_.text.find("batch-1.record-+torn.json is rejected: it fails its checksum"),
            std::string::npos)
      << warnings_.text;
}

// If the merge finds that a task's artifact is damaged, tasks build it again.
TEST_F(Cluster, ADamagedSegmentIsBuiltAgain) {
  BuildSpec twice = spec(3);
  bool was_damaged = false;
  slurm_.before_task = [&](uint32_t batch) {
    if (batch != 2 || was_damaged) return;
    was_damaged = true;
    // Batches 0 and 1 are built. Damages the first bytes of the frames of batch 0.
    for (const auto& entry : std::filesystem::directory_iterator(output() + ".work/cluster"))
      if (entry.path().filename().string().starts_with("attempt-0-"))
        for (const auto& segment : std::filesystem::directory_iterator(entry.path())) {
          std::fstream file(segment.path(), std::ios::in | std::ios::out | std::ios::binary);
          file.seekp(64);
          file.write("damage!!", 8);
        }
  };
  const BuildReport report = build(twice);
  EXPECT_TRUE(was_damaged);
  EXPECT_NE(warnings_.text.find("is built again"), std::string::npos) << warnings_.text;
  EXPECT_GE(report.cluster->batches, 4u);
}

TEST_F(Cluster, AnotherAttemptFindsTheRecord) {
  slurm_.before_task = [&](uint32_t) {
    slurm_.before_task = nullptr;
    CancelToken never;
    // A second attempt at batch 0 finds the completion record of the first attempt, and does not
    // build again.
    const BatchRun run{.work_folder = output() + ".work",
                       .batch = 0,
                       .program = kVersion,
                       .temporary_folder = "",
                       .memory_bytes = uint64_t{128} << 20,
                       .threads = 1,
                       .attempt = "first"};
    run_batch(run, {system_files(), warnings_, never});
    BatchRun second = run;
    second.attempt = "second";
    EXPECT_EQ(run_batch(second, {system_files(), warnings_, never}).attempt, "first");
  };
  EXPECT_EQ(build(spec(2)).cluster->batches, 2u);
}

TEST(ClusterParts, NamesAreParsed) {
  using Kind = ClusterFolder::Kind;
  const auto parsed = [](const std::string& name) { return parse_cluster_name(name); };
  EXPECT_EQ(parsed("batch-7.vdbatch").kind, Kind::kBatch);
  EXPECT_EQ(parsed("batch-7.vdbatch").batch, 7u);
  EXPECT_EQ(parsed("batch-12.record-0a.json").kind, Kind::kRecord);
  EXPECT_EQ(parsed("batch-12.record-0a.json").attempt, "0a");
  EXPECT_EQ(parsed("batch-12.failure-0a.json").kind, Kind::kFailure);
  EXPECT_EQ(parsed("attempt-3-ff").kind, Kind::kAttempt);
  for (const char* other : {"batch-.vdbatch", "batch-7.record-0a.json.partial", "cluster.json",
                            "attempt-3", "batch-99999999999.vdbatch", "batch-7.vdbatch.partial"})
    EXPECT_EQ(parsed(other).kind, Kind::kOther) << other;
}

TEST(ClusterParts, BatchesHaveAboutEqualWeights) {
  const std::vector<double> weights{1, 1, 1, 9, 1, 1, 1, 1, 1, 1};
  EXPECT_EQ(cut_into_batches(weights, 1), (std::vector<size_t>{10}));
  EXPECT_EQ(cut_into_batches(weights, 2), (std::vector<size_t>{4, 10}));
  EXPECT_EQ(cut_into_batches(weights, 20).size(), 10u);
  EXPECT_EQ(cut_into_batches(weights, 3).size(), 3u);
  EXPECT_EQ(default_tasks(0, 0), 1u);
  EXPECT_EQ(default_tasks(1e30, 17), 17u);
}

TEST(ClusterParts, WordsAreSplitAsAShellDoes) {
  using Words = std::vector<std::string>;
  EXPECT_EQ(split_words("  --mem=8G   --time=2:00:00 "), (Words{"--mem=8G", "--time=2:00:00"}));
  EXPECT_EQ(split_words("--comment='a b' \"c'd\" e\\ f ''"),
            (Words{"--comment=a b", "c'd", "e f", ""}));
  EXPECT_EQ(error_of([] { split_words("--comment='a"); }).code(), ErrorCode::kInvalidInput);
}

TEST(ClusterParts, RecordsSurviveTheirText) {
  CompletionRecord record;
  record.program = kVersion;
  record.batch = 3;
  record.attempt = "x";
  record.artifact = {.segment = 16777219,
                     .offset = 64,
                     .bytes = UINT64_MAX,
                     .index_offset = 7,
                     .checksum = UINT64_MAX - 1};
  record.subvolumes = {{5, {.voxels = UINT64_MAX, .svo_nodes = 2, .dag_nodes = 3, .root_hash = 4}}};
  const std::string text = encode_record(record);
  const CompletionRecord read = decode_record(text);
  EXPECT_EQ(read.artifact, record.artifact);
  EXPECT_EQ(read.subvolumes[0].summary.voxels, UINT64_MAX);
  EXPECT_EQ(encode_record(read), text);
  for (size_t length = 0; length < text.size(); ++length)
    EXPECT_EQ(error_of([&] { decode_record(text.substr(0, length)); }).code(), ErrorCode::kCorrupt);
  for (size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    EXPECT_EQ(error_of([&] { decode_record(damaged); }).code(), ErrorCode::kCorrupt) << i;
  }
}

}  // namespace
}  // namespace voxdag
