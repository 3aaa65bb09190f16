#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>

#include "server/api/problem.h"
#include "server/jobs/job_request.h"
#include "server/jobs/process/confined_files.h"
#include "server/jobs/process/task.h"
#include "server/jobs/settlement.h"
#include "tests/unit/io/temporary_folder.h"

namespace voxdag::server {
namespace {

TEST(JobRequestBody, HasTheOptionsOfTheCommandLine) {
  const JobRequest request = parse_job_request(R"({
      "scene": ["a.glb", "/srv/b.gltf"], "resolution": 4096, "name": "n", "priority": -3,
      "options": {"bounds": [0, -1.5, 2, 8], "skip_invalid": true, "hash_bits": 16,
                  "memory": "2GiB", "threads": 2, "subvolume": 512, "backend": "cpu",
                  "method": "consing"}})");
  EXPECT_EQ(request.scenes, (std::vector<std::string>{"a.glb", "/srv/b.gltf"}));
  EXPECT_EQ(request.name, "n");
  EXPECT_EQ(request.priority, -3);
  const GeometryOptions& g = request.spec.geometry;
  EXPECT_EQ(g.resolution, 4096u);
  EXPECT_EQ(g.bounds, (std::array<double, 4>{0, -1.5, 2, 8}));
  EXPECT_TRUE(g.skip_invalid);
  EXPECT_EQ(g.hash_bits, 16u);
  EXPECT_EQ(request.spec.run.memory_bytes, uint64_t{2} << 30);
  EXPECT_EQ(request.spec.run.threads, 2u);
  EXPECT_EQ(request.spec.run.subvolume_edge, 512u);
  EXPECT_EQ(parse_job_request(request.text).spec.geometry.bounds, g.bounds)
      << "what is kept can be read again";
}

TEST(JobRequestBody, IsRefusedByName) {
  const std::pair<const char*, const char*> bodies[] = {
      {"", "JSON"},
      {"[]", "object"},
      {"{\"resolution\":64}", "'scene'"},
      {"{\"scene\":\"a.glb\"}", "'resolution'"},
      {"{\"scene\":\"a.glb\",\"resolution\":65}", "'resolution'"},
      {"{\"scene\":\"a.glb\",\"resolution\":2097152}", "'resolution'"},
      {"{\"scene\":\"a.glb\",\"resolution\":-64}", "'resolution'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64.5}", "'resolution'"},
      {"{\"scene\":\"a.glb\",\"resolution\":1e300}", "'resolution'"},
      {"{\"scene\":[],\"resolution\":64}", "'scene'"},
      {"{\"scene\":\"a\\u0000.glb\",\"resolution\":64}", "'scene'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"output\":\"/etc/x\"}", "'output'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"priority\":101}", "'priority'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"work\":\"/\"}}", "'work'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"memory\":\"1MiB\"}}", "'memory'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"memory\":\"x\"}}", "'memory'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"bounds\":[0,0,0]}}", "'bounds'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"bounds\":[0,0,0,0]}}", "'bounds'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"voxel_size\":0}}", "'voxel_size'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"bounds\":[0,0,0,1],\"voxel_size\":1}"
       "}",
       "'voxel_size'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"backend\":\"gpu\"}}", "'backend'"},
  };
  for (const auto& [body, part] : bodies) {
    SCOPED_TRACE(body);
    try {
      parse_job_request(body);
      ADD_FAILURE() << "was taken";
    } catch (const Problem& problem) {
      EXPECT_EQ(problem.status, 400);
      EXPECT_NE(problem.detail.find(part), std::string::npos) << problem.detail;
    }
  }
}

TEST(TaskFile, IsReadAsItWasWritten) {
  const TemporaryFolder folder;
  Task task;
  task.kind = Task::Kind::kPlan;
  task.text = "{\"a\":1}";
  task.scene_paths = {"/x/a.glb"};
  task.readable = {"/x/"};
  task.memory_bytes = 123;
  task.threads = 3;
  write_task(system_files(), folder.file("task.json"), task);
  const Task back = read_task(system_files(), folder.file("task.json"));
  EXPECT_EQ(back.kind, task.kind);
  EXPECT_EQ(back.text, task.text);
  EXPECT_EQ(back.scene_paths, task.scene_paths);
  EXPECT_EQ(back.readable, task.readable);
  EXPECT_EQ(back.memory_bytes, 123u);
  EXPECT_EQ(back.threads, 3u);
}

// A process of ours is trusted no more than a file: its lines are checked.
TEST(ReportLine, IsReadOrIgnored) {
  Report report;
  report.kind = Report::Kind::kWarning;
  report.text = "a \"text\"\nof two lines \xff";
  const auto back = parse_report(report_line(report));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->kind, Report::Kind::kWarning);
  EXPECT_EQ(back->text.substr(0, 8), "a \"text\"");
  for (const char* line : {"", "hello", "[]", "[99,\"\",\"\",\"\",0,0,0,0,0,0,0]", "{\"a\":1}",
                           "[0,1,2,3,4,5,6,7,8,9,10]"}) {
    SCOPED_TRACE(line);
    EXPECT_FALSE(parse_report(line));
  }
}

// Neither dots nor symbolic links lead out of what a scene may read.
TEST(ConfinedFilesTest, OpensNothingOutside) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.file("in/side"));
  for (const char* name : {"in/a", "in/side/b", "out", "inside"})
    write_file_atomically(system_files(), folder.file(name), "x");
  std::filesystem::create_symlink(folder.file("out"), folder.file("in/link"));
  std::filesystem::create_symlink(folder.path(), folder.file("in/up"));
  ConfinedFiles files(system_files(), {folder.file("in") + "/", folder.file("missing")});
  EXPECT_EQ(files.open_read(folder.file("in/a"))->size(), 1u);
  EXPECT_EQ(files.open_read(folder.file("in/side/../side/b"))->size(), 1u);
  for (const char* name : {"out", "inside", "in/link", "in/../out", "in/up/out"}) {
    SCOPED_TRACE(name);
    EXPECT_THROW(files.open_read(folder.file(name)), Error);
  }
  ConfinedFiles one(system_files(), {folder.file("in/a")});
  EXPECT_EQ(one.open_read(folder.file("in/a"))->size(), 1u);
  EXPECT_THROW(one.open_read(folder.file("in/side/b")), Error);
}

class Settlement : public testing::Test {
 protected:
  Settlement() {
    job_.state = JobState::kRunning;
    job_.attempts = 1;
  }
  void fail(const char* code) {
    Report report;
    report.kind = Report::Kind::kError;
    report.code = code;
    live_.take(report);
  }
  void settle(ChildProcess::End end = {}) { settle_job(job_, live_, end, limits_, 1000); }

  JobLimits limits_;
  Job job_;
  LiveJob live_{"id", 0};
};

TEST_F(Settlement, ARunWithAResultSucceeds) {
  Report report;
  report.kind = Report::Kind::kResult;
  report.text = "{}";
  live_.take(report);
  settle();
  EXPECT_EQ(job_.state, JobState::kSucceeded);
  EXPECT_EQ(job_.result, "{}");
  EXPECT_EQ(job_.finished_s, 1000);
}

TEST_F(Settlement, AFullDiskIsTriedAgainLaterAndLater) {
  fail("no_space");
  settle();
  EXPECT_EQ(job_.state, JobState::kQueued);
  EXPECT_EQ(job_.not_before_s, 1000 + limits_.backoff_s);
  job_.state = JobState::kRunning;
  job_.attempts = 3;
  settle();
  EXPECT_EQ(job_.not_before_s, 1000 + 4 * limits_.backoff_s);
  job_.state = JobState::kRunning;
  job_.attempts = limits_.attempts;
  settle();
  EXPECT_EQ(job_.state, JobState::kFailed);
  EXPECT_TRUE(job_.error->transient);
}

TEST_F(Settlement, ABrokenSceneFailsAtOnce) {
  fail("invalid_input");
  settle();
  EXPECT_EQ(job_.state, JobState::kFailed);
  EXPECT_FALSE(job_.error->transient);
}

TEST_F(Settlement, ACrashIsNoSecret) {
  settle({0, SIGSEGV});
  EXPECT_EQ(job_.state, JobState::kFailed);
  EXPECT_EQ(job_.error->code, "internal");
  job_.state = JobState::kRunning;
  settle({0, SIGKILL});
  EXPECT_EQ(job_.error->code, "out_of_memory");
}

TEST_F(Settlement, WhatWasStoppedBecomesWhatWasAskedFor) {
  live_.stop();
  fail("canceled");
  settle();
  EXPECT_EQ(job_.state, JobState::kQueued) << "the service stops";
  EXPECT_TRUE(job_.front);
  EXPECT_FALSE(job_.error);
  job_.state = JobState::kCanceling;
  settle();
  EXPECT_EQ(job_.state, JobState::kCanceled);
  job_.state = JobState::kSuspended;
  settle();
  EXPECT_EQ(job_.state, JobState::kSuspended);
}

}  // namespace
}  // namespace voxdag::server
