// Simulates Slurm: tasks run in the process of the test, and end as the test specifies. Also has
// the fixture of tests that build with the simulated Slurm.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <climits>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "scheduler/run_build.h"
#include "scheduler/slurm/commands/command_runner.h"
#include "scheduler/slurm/run_batch.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag {

inline constexpr const char* kVersion = "1.2.3";

// Answers the commands sbatch, squeue, scontrol and scancel. sbatch runs each task immediately,
// unless the next entry of `fates` is a state: then the task does nothing and ends in this state.
// With the fate kHeld, it is pending until scancel.
class PlayedSlurm : public CommandRunner {
 public:
  static constexpr const char* kHeld = "held";
  std::deque<std::string> fates;  // one per task, in order; "": it runs
  uint32_t max_array_size = 1001;
  size_t max_tasks = SIZE_MAX;  // largest array that sbatch accepts
  int squeue_failures = 0;
  std::string refusal;       // error text of sbatch; "": it accepts tasks
  int refusals = INT_MAX;    // calls of sbatch that fail with `refusal`
  std::string test_refusal;  // error text of sbatch --test-only
  int test_refusals = INT_MAX;
  std::vector<std::vector<std::string>> commands;
  std::string program = kVersion;
  std::string temporary_folder;
  std::function<void(uint32_t batch)> before_task;
  std::function<void()> merge_job;           // does the work of the merge job
  std::string waiting_merge_job;             // id of the merge job while it waits; else ""
  std::string merge_state = "RUNNING|None";  // state of the merge job before its end
  std::string merge_end = "COMPLETED Reason=None ExitCode=0:0";

  CommandResult run(const std::vector<std::string>& command, const std::string& input, double,
                    const CancelToken&) override {
    commands.push_back(command);
    if (command[0] == "sbatch")
      return command[1] != "--test-only"                    ? submit(command, input)
             : test_refusal.empty() || test_refusals-- <= 0 ? ok("")
                                                            : CommandResult{1, "", test_refusal};
    if (command[0] == "squeue" && command[3].ends_with("-merge")) return show_merge_job();
    if (command[0] == "squeue") {
      if (squeue_failures > 0) {
        --squeue_failures;
        return {1, "", "slurm_load_jobs error: Unable to contact slurm controller"};
      }
      std::string listed;
      for (const auto& [task, line] : held) listed += line;
      return ok(listed);
    }
    if (command[0] == "scontrol" && command[2] == "config")
      return ok("MaxArraySize            = " + std::to_string(max_array_size) +
                "\nAccountingStorageType   = accounting_storage/none\n");
    if (command[0] == "scontrol") return ok(ends[command.back()]);
    if (command[0] == "scancel") {
      for (const std::string& task : command)
        if (held.erase(task) > 0)
          ends[task] = "JobState=CANCELLED Reason=None NodeList= ExitCode=0:0";
      return ok("");
    }
    return {127, "", command[0] + ": command not found"};
  }

 private:
  // Answers squeue about the merge job. If the job waits, runs merge_job(). The job has then ended,
  // unless merge_job() sets waiting_merge_job again.
  CommandResult show_merge_job() {
    if (waiting_merge_job.empty()) return ok("");
    const std::string id = std::exchange(waiting_merge_job, "");
    ends[id] = "JobState=" + merge_end;
    if (merge_job) merge_job();
    return ok(id + "|" + merge_state + "\n");
  }

  static CommandResult ok(const std::string& output) { return {0, output, ""}; }

  CommandResult submit(const std::vector<std::string>& command, const std::string& script) {
    if (!refusal.empty() && refusals-- > 0) return {1, "", refusal};
    const std::string job = std::to_string(++jobs);
    uint32_t first = 0;
    std::string indexes;
    for (const std::string& word : command) {
      if (word.starts_with("--comment="))
        first = static_cast<uint32_t>(std::stoul(word.substr(10)));
      if (word.starts_with("--array=")) indexes = word.substr(8);
    }
    if (indexes.empty()) return ok((waiting_merge_job = job) + "\n");
    EXPECT_NE(script.find("$((" + std::to_string(first) + " + SLURM_ARRAY_TASK_ID))"),
              std::string::npos);
    std::vector<unsigned long> tasks;
    std::istringstream in(indexes);
    for (std::string range; std::getline(in, range, ',');) {
      const size_t dash = range.find('-');
      const unsigned long low = std::stoul(range);
      const unsigned long high =
          dash == std::string::npos ? low : std::stoul(range.substr(dash + 1));
      EXPECT_LT(high, max_array_size);
      for (unsigned long i = low; i <= high; ++i) tasks.push_back(i);
    }
    if (tasks.size() > max_tasks) return {1, "", "error: QOSMaxSubmitJobPerUserLimit"};
    for (const unsigned long i : tasks)
      run_task(work_of(script), job + "_" + std::to_string(i), first + static_cast<uint32_t>(i));
    return ok(job + "\n");
  }

  static std::string work_of(const std::string& script) {
    const size_t begin = script.find("'build-batch' '") + 15;
    return script.substr(begin, script.find('\'', begin) - begin);
  }

  void run_task(const std::string& work, const std::string& task, uint32_t batch) {
    std::string fate;
    if (!fates.empty()) {
      fate = fates.front();
      fates.pop_front();
    }
    if (before_task) before_task(batch);
    if (fate == kHeld) {
      const size_t index = task.find('_') + 1;
      held[task] = task.substr(0, index - 1) + "|" + task.substr(index) + "|PENDING|" +
                   std::to_string(batch - std::stoul(task.substr(index))) +
                   "||launch failed requeued held\n";
      return;
    }
    ends[task] =
        "JobState=" + (fate.empty() ? "COMPLETED" : fate) + " Reason=None NodeList=n7 ExitCode=0:0";
    if (!fate.empty()) return;
    NoProgress progress;
    CancelToken never;
    try {
      run_batch({.work_folder = work,
                 .batch = batch,
                 .program = program,
                 .temporary_folder = temporary_folder,
                 .memory_bytes = uint64_t{128} << 20,
                 .threads = 2,
                 .attempt = ""},
                {system_files(), progress, never});
    } catch (const Error&) {
      ends[task] = "JobState=FAILED Reason=NonZeroExitCode NodeList=n7 ExitCode=2:0";
    }
  }

  int jobs = 0;
  std::map<std::string, std::string> ends;
  std::map<std::string, std::string> held;  // lines that squeue prints, by task
};

// Collects the texts of warnings.
class Warnings : public NoProgress {
 public:
  void warn(std::string_view message) override { text += std::string(message) + "\n"; }
  std::string text;
};

class Cluster : public testing::Test {
 protected:
  void SetUp() override {
    write_spheres(scene(), 20000);
    expected_ = run_build(local_spec(), context()).sha256;
    warnings_.text.clear();
  }
  std::string scene() const { return folder_.file("scene.glb"); }
  std::string output() const { return folder_.file("out.vdag"); }
  BuildSpec local_spec() const { return spheres_build(scene(), output()); }
  BuildSpec spec(uint64_t tasks) {
    BuildSpec cluster = local_spec();
    cluster.run.subvolume_edge = 64;
    cluster.run.cluster.emplace();
    ClusterOptions& options = *cluster.run.cluster;
    options.engine = ClusterEngine::kSlurm;
    options.tasks = tasks;
    options.program_path = "/usr/bin/voxdag";
    options.program_version = kVersion;
    options.grace_s = 0;
    options.slurm_interval_s = 0.01;
    options.commands = &slurm_;
    return cluster;
  }
  BuildContext context() { return {system_files(), warnings_, cancel_}; }
  // Builds on the simulated cluster, and checks that the bytes equal a local build's.
  BuildReport build(const BuildSpec& cluster_spec) {
    BuildReport report = run_build(cluster_spec, context());
    EXPECT_EQ(report.sha256, expected_);
    EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
    return report;
  }
  size_t count(const std::string& program) const {
    return static_cast<size_t>(std::ranges::count_if(
        slurm_.commands, [&](const auto& command) { return command[0] == program; }));
  }

  const TemporaryFolder folder_;
  PlayedSlurm slurm_;
  Warnings warnings_;
  CancelToken cancel_;
  std::string expected_;
};

}  // namespace voxdag
