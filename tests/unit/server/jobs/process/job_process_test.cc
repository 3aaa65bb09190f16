// Runs the process of a job with failures of the machine. Whatever fails, its reports and logs
// contain no folder of the machine. If the scene causes the failure, the message names the scene.
#include "server/jobs/process/job_process.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "scheduler/state/work_folder.h"
#include "server/disk/data_folder.h"
#include "server/jobs/protocol/job_folder.h"
#include "server/jobs/protocol/job_messages.h"
#include "server/jobs/protocol/job_task.h"
#include "tests/support/faulty_files.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

using crash::Fault;
using crash::FaultPlan;
using crash::FaultyFiles;

constexpr const char* kPositions =
    "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";

std::string scene_with_buffer(const std::string& uri) {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
                  "min":[0,0,0],"max":[1,1,0]}],
    "bufferViews":[{"buffer":0,"byteLength":36}],
    "buffers":[{"byteLength":36,"uri":")" +
         uri + "\"}]}";
}

class JobProcess : public testing::Test {
 protected:
  JobProcess() {
    std::filesystem::create_directories(folder_.file("scenes"));
    put_scene(scene_with_buffer(kPositions));
    start_over();
  }
  std::string scene_path() const { return folder_.file("scenes/scene.gltf"); }
  void put_scene(const std::string& text) {
    write_file_atomically(system_files(), scene_path(), text);
  }
  // Replaces the job folder with a new one that contains only the task, as the service does.
  void start_over(JobTask::Kind kind = JobTask::Kind::kBuild) {
    remove_tree(system_files(), job_.path);
    std::filesystem::create_directories(job_.path);
    JobTask task;
    task.kind = kind;
    task.request = R"({"scene":["scene.gltf"],"resolution":64,"options":{}})";
    task.uploads = {{"scene.gltf", scene_path()}};
    task.readable = {scene_path()};
    task.memory_bytes = uint64_t{256} << 20;
    task.threads = 1;
    write_task(system_files(), job_.task(), task);
  }

  struct Run {
    int exit_status = -1;
    std::string output, log;
    // Returns the last reported failure as "CODE: MESSAGE"; "" if no failure was
    // reported.
    std::string failure() const {
      std::string found, line;
      for (std::istringstream lines(output); std::getline(lines, line);)
        if (const auto message = decode(line))
          if (const auto* failure = std::get_if<Failure>(&*message))
            found = failure->code + ": " + failure->text;
      return found;
    }
  };
  // Runs the job in a child process, because a job changes its working directory. Checks that no
  // output contains a folder of the machine. `plan` is the fault to inject.
  Run run(FaultPlan plan = {}) {
    const std::string output = folder_.file("stdout"), log = folder_.file("stderr");
    const pid_t child = fork();
    if (child == 0) {
      if (!freopen(output.c_str(), "w", stdout) || !freopen(log.c_str(), "w", stderr)) _exit(99);
      FaultyFiles files(plan);
      const CancelToken cancel;
      _exit(run_job(files, job_.path, cancel));
    }
    int status = 0;
    waitpid(child, &status, 0);
    const Run run{WIFEXITED(status) ? WEXITSTATUS(status) : -1, contents(output), contents(log)};
    EXPECT_EQ(run.output.find(folder_.path()), std::string::npos) << run.output;
    EXPECT_EQ(run.log.find(folder_.path()), std::string::npos) << run.log;
    return run;
  }
  static std::string contents(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  // Expects that the run has failed and that its last reported failure contains `part`.
  void expect_failure(const std::string& part, const Run& run) {
    EXPECT_GT(run.exit_status, 0);
    EXPECT_NE(run.failure().find(part), std::string::npos) << run.failure() << "\n" << run.log;
  }

  const TemporaryFolder folder_;
  const JobFolder job_{folder_.file("jobs-of-the-service")};
};

TEST_F(JobProcess, BuildsAndReportsItsResult) {
  const Run first = run();
  EXPECT_EQ(first.exit_status, 0) << first.log;
  EXPECT_NE(first.output.find("\"message\":\"result\""), std::string::npos);
  EXPECT_NE(contents(job_.subvolumes()).find("\"built\":1,\"total\":1"), std::string::npos)
      << contents(job_.subvolumes());
  EXPECT_FALSE(std::filesystem::exists(job_.work()));
  // Runs the finished job again, as if the service had been killed before it received the result.
  const Run again = run();
  EXPECT_EQ(again.exit_status, 0) << again.log;
  EXPECT_EQ(again.output.substr(again.output.rfind("{\"json\"")),
            first.output.substr(first.output.rfind("{\"json\"")));
}

// The list of subvolumes of an earlier run is kept until the new run has a plan, if the earlier
// run's work folder still exists. Otherwise it is removed.
TEST_F(JobProcess, ListsNothingOfAnEarlierRunBeforeItsOwnPlan) {
  put_scene("no scene at all");
  write_file_atomically(system_files(), job_.subvolumes(), "the list");
  std::filesystem::create_directories(job_.work());
  const std::string store = WorkFolder::store_path(job_.work());
  write_file_atomically(system_files(), store, "");
  EXPECT_GT(run().exit_status, 0);
  EXPECT_EQ(contents(job_.subvolumes()), "the list");
  remove_tree(system_files(), job_.work());
  EXPECT_GT(run().exit_status, 0);
  EXPECT_FALSE(std::filesystem::exists(job_.subvolumes()));
}

TEST_F(JobProcess, NamesTheSceneAsTheClientDid) {
  put_scene("no scene at all");
  expect_failure("invalid_input: scene.gltf", run());
  put_scene(scene_with_buffer("other.bin"));
  expect_failure("other.bin", run());
  system_files().remove(scene_path());
  expect_failure("scene.gltf", run());
  std::filesystem::create_directories(scene_path());
  expect_failure("scene.gltf", run());
}

// A scene whose buffer has the path of a file of the service or of the job is refused.
TEST_F(JobProcess, ReadsNoFileOfTheServiceAsABuffer) {
  write_file_atomically(system_files(), folder_.file("secret.bin"), std::string(36, 'x'));
  for (const char* uri : {"../secret.bin", "task.json", "log"}) {
    SCOPED_TRACE(uri);
    write_file_atomically(system_files(), job_.log(), std::string(36, 'x'));
    put_scene(scene_with_buffer(uri));
    expect_failure("is outside", run());
  }
}

TEST_F(JobProcess, NamesNoFolderOfABrokenJob) {
  std::filesystem::create_directories(job_.work());
  std::ofstream(job_.work() + "/job.db") << std::string(8192, 'x');
  expect_failure("job.db", run());
  start_over();
  std::filesystem::create_directories(job_.work());
  std::ofstream(job_.work() + "/somebody-elses") << "x";
  expect_failure("work", run());
  start_over();
  std::ofstream(job_.work()) << "a file in place of a folder";
  expect_failure("work", run());
  start_over();
  std::filesystem::create_directories(job_.result());
  expect_failure("result.vdag", run());
  std::ofstream(job_.task()) << "{";
  expect_failure("task.json", run());
  system_files().remove(job_.task());
  expect_failure("task.json", run());
  remove_tree(system_files(), job_.path);
  expect_failure("the job's folder", run());
}

// If the disk is full, or fails, from any operation on, the job reports a failure. run() checks
// that no message contains a folder of the machine.
TEST_F(JobProcess, NamesNoFolderOfABrokenDisk) {
  for (const Fault fault : {Fault::kNoSpace, Fault::kIoError, Fault::kReadError}) {
    for (const JobTask::Kind kind : {JobTask::Kind::kBuild, JobTask::Kind::kPlan}) {
      for (uint64_t at = 1; at < 100; ++at) {
        SCOPED_TRACE(testing::Message() << static_cast<int>(fault) << " at " << at);
        start_over(kind);
        const Run broken = run({fault, at});
        if (broken.exit_status == 0) break;
        EXPECT_NE(broken.failure(), "") << broken.log;
      }
    }
  }
}

}  // namespace
}  // namespace voxdag::server
