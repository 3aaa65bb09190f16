#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/fields/json_schema.h"
#include "core/io/file_system.h"
#include "server/base/request_error.h"
#include "server/jobs/job_outcome.h"
#include "server/jobs/process/confined_files.h"
#include "server/jobs/process/progress_pipe.h"
#include "server/jobs/process/subvolume_map.h"
#include "server/jobs/protocol/job_request.h"
#include "server/jobs/protocol/job_task.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;

TEST(JobRequestBody, HasTheOptionsOfTheCommandLine) {
  const JobRequest request = parse_job_request(R"({
      "scene": ["a.glb", "/srv/b.gltf"], "resolution": 4096, "name": "n", "priority": -3,
      "options": {"bounds": [0, -1.5, 2, 8], "skip_invalid": true, "hash_bits": 16, "order": "first-parent",
                  "ignore_extension": ["ACME_bent", "ACME_twisted"],
                  "attributes": ["normal", "material"], "color_resolution": 64,
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
  EXPECT_EQ(g.order, OrderName::kFirstParent);
  EXPECT_EQ(g.ignore_extension, (std::vector<std::string>{"ACME_bent", "ACME_twisted"}));
  EXPECT_EQ(g.attributes, (AttributeSet{Attribute::kNormal, Attribute::kMaterial}));
  EXPECT_EQ(g.color_resolution, 64u);
  EXPECT_EQ(request.spec.run.memory_bytes, uint64_t{2} << 30);
  EXPECT_EQ(request.spec.run.threads, 2u);
  EXPECT_EQ(request.spec.run.subvolume_edge, 512u);
  EXPECT_EQ(parse_job_request(request.text).spec.geometry.bounds, g.bounds)
      << "the stored text can be read again";
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
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"color\":true,"
       "\"color_resolution\":128}}",
       "'color_resolution'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"color_resolution\":32}}",
       "'color_resolution'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"attributes\":[\"normals\"]}}",
       "'attributes'"},
      {"{\"scene\":\"a.glb\",\"resolution\":64,\"options\":{\"attributes\":[]}}", "'attributes'"},
  };
  for (const auto& [body, part] : bodies) {
    SCOPED_TRACE(body);
    try {
      parse_job_request(body);
      ADD_FAILURE() << "was accepted";
    } catch (const RequestError& error) {
      EXPECT_EQ(error.kind(), RequestError::Kind::kInvalid);
      EXPECT_NE(error.message().find(part), std::string::npos) << error.message();
    }
  }
}

// Expects that the form of the web page has each option of a job, with the same choices and limits.
// `page` is the source of the form.
struct FormFinder {
  template <class T>
  void operator()(const Field& field, T&) {
    SCOPED_TRACE(field.name);
    const std::string name = field.name;
    EXPECT_THAT(page, ContainsRegex("[ {]" + name + ":[ \n]"));
    using Value = typename OptionalValue<T>::type;
    if constexpr (NamedEnum<Value>) {
      for (const std::string& choice : choices_of<Value>())
        if (choice != name_of(Value{})) {
          EXPECT_THAT(page, HasSubstr("[\"" + choice + "\", \""));
        }
    } else if constexpr (NameSet<Value>) {
      for (const std::string& choice : NameSetTraits<Value>::all())
        EXPECT_THAT(page, ContainsRegex("[ {]" + choice + ": "));
    } else if (field.min && field.max && !field.is_power_of_two && !field.is_line) {
      EXPECT_THAT(page, HasSubstr(name + ": this.number({min: \"" + std::to_string(*field.min) +
                                  "\", max: \"" + std::to_string(*field.max) + "\""));
    }
    ++count;
  }

  std::string page;
  int count = 0;
};

TEST(JobForm, HasTheOptionsOfTheDescription) {
  FormFinder form{read_small_file(system_files(),
                                  VOXDAG_SOURCE_DIR "/server/web/views/job_options.js", 1 << 20)};
  BuildSpec spec;
  visit_job_options(form, spec);
  EXPECT_GE(form.count, 12);
}

TEST(JobRequestSchema, HasTheMembersOfTheRequest) {
  const FieldJson schema = options_schema<JobRequest>();
  EXPECT_EQ(schema.at("required").dump(), R"(["scene","resolution"])");
  const FieldJson& options = schema.at("properties").at("options").at("properties");
  EXPECT_EQ(options.at("hash_bits").at("maximum"), 64);
  EXPECT_EQ(options.at("backend").at("enum").dump(), R"(["auto","cpu","cuda","parallel-host"])");
  EXPECT_FALSE(options.contains("work")) << "a client does not choose folders of the server";
}

TEST(TaskFile, IsReadAsItWasWritten) {
  const TemporaryFolder folder;
  JobTask task;
  task.kind = JobTask::Kind::kPlan;
  task.request = "{\"a\":1}";
  task.uploads = {{"a.glb", "/x/a.glb"}};
  task.readable = {"/x/"};
  task.memory_bytes = 123;
  task.threads = 3;
  task.cache_folder = "/x/cache";
  task.cache_bytes = 456;
  write_task(system_files(), folder.file("task.json"), task);
  const JobTask back = read_task(system_files(), folder.file("task.json"));
  EXPECT_EQ(back.kind, task.kind);
  EXPECT_EQ(back.request, task.request);
  EXPECT_EQ(back.uploads, task.uploads);
  EXPECT_EQ(back.readable, task.readable);
  EXPECT_EQ(back.memory_bytes, 123u);
  EXPECT_EQ(back.threads, 3u);
  EXPECT_EQ(back.cache_folder, task.cache_folder);
  EXPECT_EQ(back.cache_bytes, 456u);
}

template <class M>
M sent(const M& message) {
  const auto received = decode(encode(message));
  if (received && std::holds_alternative<M>(*received)) return std::get<M>(*received);
  ADD_FAILURE() << encode(message);
  return {};
}

TEST(Messages, AreReadAsTheyWereWritten) {
  const StageBegun begun = sent(StageBegun{"build", "subvolumes", 64});
  EXPECT_EQ(begun.stage, "build");
  EXPECT_EQ(begun.unit, "subvolumes");
  EXPECT_EQ(begun.total, 64u);
  EXPECT_EQ(sent(StageResumed{12}).done, 12u);
  const StageAdvanced advanced = sent(StageAdvanced{12, UINT64_MAX});
  EXPECT_EQ(advanced.done, 12u);
  EXPECT_EQ(advanced.total, UINT64_MAX);
  sent(StageEnded{});
  const SubvolumeTotals totals = sent(SubvolumeTotals{1, 2, 3, 4, 5});
  EXPECT_EQ(totals.built, 1u);
  EXPECT_EQ(totals.total, 2u);
  EXPECT_EQ(totals.voxels, 3u);
  EXPECT_EQ(totals.nodes, 4u);
  EXPECT_EQ(totals.bytes, 5u);
  const Usage usage = sent(Usage{6, 7});
  EXPECT_EQ(usage.memory_bytes, 6u);
  EXPECT_EQ(usage.disk_bytes, 7u);
  const ClusterTasks tasks = sent(ClusterTasks{9, 2, 4, 1, {{"n1", 2}, {"n2", 1}}, {{"n3", 2}}});
  EXPECT_EQ(tasks.batches, 9u);
  EXPECT_EQ(tasks.built, 2u);
  EXPECT_EQ(tasks.waiting, 4u);
  EXPECT_EQ(tasks.failed_attempts, 1u);
  EXPECT_EQ(tasks.running.at("n2"), 1u);
  EXPECT_EQ(tasks.built_of_node.at("n3"), 2u);
  const Warning warning{"a-code", "a \"place\"", "two\nlines", 12};
  EXPECT_EQ(sent(WarningReported{warning}).warning, warning);
  EXPECT_EQ(sent(WarningReported{{"", "", "no UTF-8: \xff"}}).warning.message.substr(0, 10),
            "no UTF-8: ");
  const Failure failure = sent(Failure{"no_space", "full"});
  EXPECT_EQ(failure.code, "no_space");
  EXPECT_EQ(failure.text, "full");
  EXPECT_EQ(sent(Result{"{\"a\":1}"}).json, "{\"a\":1}");
}

TEST(Messages, AreLinesOfNamedMembers) {
  EXPECT_EQ(encode(StageAdvanced{12, 64}), R"({"done":12,"message":"stage_advanced","total":64})");
  EXPECT_EQ(
      encode(WarningReported{{"a", "b", "two\nlines"}}),
      R"({"message":"warning","warning":{"code":"a","count":1,"message":"two\nlines","place":"b"}})");
}

// The service ignores malformed messages and unknown kinds of messages from a job's process,
// because it does not trust the process.
TEST(Messages, BrokenOrUnknownLinesAreIgnored) {
  for (const char* line :
       {"", "hello", "[]", "null", "{", "{\"a\":1}", "[0,1,2,3,4,5,6,7,8,9,10]", R"({"message":1})",
        R"({"message":"unknown"})", R"({"message":"warning"})",
        R"({"message":"warning","warning":1})", R"({"message":"stage_advanced","done":1})",
        R"({"message":"stage_advanced","done":-1,"total":2})",
        R"({"message":"stage_advanced","done":1.5,"total":2})",
        R"({"message":"stage_begun","stage":"s","unit":"u","total":"3"})",
        R"({"message":"cluster_tasks","batches":1})",
        R"({"message":"cluster_tasks","batches":1,"built":0,"waiting":1,"failed_attempts":0,)"
        R"("running":{"n1":-1},"built_of_node":{}})",
        R"({"message":"failure","code":"io"})", R"({"message":"result","json":{}})"}) {
    SCOPED_TRACE(line);
    EXPECT_FALSE(decode(line));
  }
}

// Unknown members of a message are skipped without recursion, so that deeply nested values cause no
// stack overflow.
TEST(Messages, MayHaveADeepMember) {
  constexpr size_t kDepth = 1'000'000;
  const std::string deep = std::string(kDepth, '[') + std::string(kDepth, ']');
  EXPECT_TRUE(decode(R"({"message":"stage_ended","x":)" + deep + "}"));
  EXPECT_FALSE(decode(R"({"message":"warning","warning":)" + deep + "}"));
  EXPECT_FALSE(decode(deep));
}

TEST(Progress, IsPutTogetherFromMessages) {
  LiveJob live(0);
  EXPECT_EQ(live.progress_json(), "");
  live.apply(StageAdvanced{1, 2});
  EXPECT_EQ(live.progress_json(), "") << "no stage has begun";
  live.apply(StageBegun{"build", "subvolumes", 4});
  live.apply(SubvolumeTotals{1, 4, 100, 20, 300});
  live.apply(Usage{5000, 6000});
  live.apply(StageAdvanced{1, 5});
  const auto progress = nlohmann::json::parse(live.progress_json());
  EXPECT_EQ(progress["stage"], "build");
  EXPECT_EQ(progress["done"], 1);
  EXPECT_EQ(progress["total"], 5);
  EXPECT_EQ(progress["subvolumes"], nlohmann::json({{"built", 1}, {"total", 4}}));
  EXPECT_EQ(progress["voxels"], 100);
  EXPECT_EQ(progress["nodes"], 20);
  EXPECT_EQ(progress["bytes"], 300);
  EXPECT_EQ(progress["memory_bytes"], 5000);
  EXPECT_EQ(progress["disk_bytes"], 6000);
  EXPECT_FALSE(progress.contains("cluster"));
  live.apply(ClusterTasks{9, 2, 4, 1, {{"n1", 2}}, {{"n1", 1}, {"n3", 1}}});
  EXPECT_EQ(
      nlohmann::json::parse(live.progress_json())["cluster"],
      nlohmann::json::parse(R"({"batches":9,"built":2,"waiting":4,"failed_attempts":1,"nodes":[
              {"name":"n1","running":2,"built":1},{"name":"n3","running":0,"built":1}]})"));
}

// The progress of a resumed stage includes the units of earlier attempts. The rate does not,
// because this attempt did not do them.
TEST(Progress, GoesOnWhereAnEarlierAttemptEnded) {
  LiveJob live(0);
  live.apply(StageBegun{"build", "subvolumes", 4'000'000});
  live.apply(StageResumed{3'000'000});
  const auto resumed = nlohmann::json::parse(live.progress_json());
  EXPECT_EQ(resumed["done"], 3'000'000);
  EXPECT_EQ(resumed["stages"][0]["resumed_at"], 3'000'000);
  EXPECT_EQ(resumed["rate"], 0);
  live.apply(StageAdvanced{3'000'001, 4'000'000});
  const auto advanced = nlohmann::json::parse(live.progress_json());
  const double wall_s = advanced["stages"][0]["wall_s"];
  EXPECT_DOUBLE_EQ(advanced["rate"].get<double>() * wall_s, 1);
}

// The map counts each built subvolume once. From the start, it also counts the subvolumes that an
// earlier run has built. A split replaces a subvolume with its parts.
TEST(Subvolumes, AreCountedAndListed) {
  SubvolumeMap map;
  const SubvolumeStatus built{1, {0, 0, 0}, 512, true, 10, 5, 100};
  const SubvolumeStatus planned{2, {512, 0, 0}, 512, false, 0, 0, 0};
  map.set_grid({-1.5, 0, 0.1}, 2);
  map.set(1024, std::vector{built, planned});
  EXPECT_EQ(map.totals().built, 1u);
  EXPECT_EQ(map.totals().total, 2u);
  map.built(built);
  EXPECT_EQ(map.totals().voxels, 10u) << "counted once";
  const SubvolumeStatus part{3, {512, 256, 0}, 256, false, 0, 0, 0};
  const SubvolumeStatus other{4, {768, 0, 0}, 256, false, 0, 0, 0};
  map.split(2, std::vector{part, other});
  SubvolumeStatus done = part;
  done.voxels = 7;
  done.nodes = 3;
  done.bytes = 50;
  map.begun(3);
  map.begun(4);
  map.built(done);
  EXPECT_EQ(map.totals().built, 2u);
  EXPECT_EQ(map.totals().total, 3u);
  EXPECT_EQ(map.totals().voxels, 17u);
  EXPECT_EQ(map.totals().nodes, 8u);
  EXPECT_EQ(map.totals().bytes, 150u);
  EXPECT_EQ(map.json(), R"({"resolution":1024,"built":2,"total":3,)"
                        R"("cubes":[[0,0,0,512,1],[512,256,0,256,1],[768,0,0,256,0]],)"
                        R"("working":[[768,0,0,256]],"origin":[-1.5,0,0.1],"edge":2})");
  map.stop();
  EXPECT_NE(map.json().find(R"("working":[])"), std::string::npos);
  map.set(1024, std::vector{planned});
  EXPECT_EQ(map.totals().built, 0u) << "a damaged one is planned again";
  EXPECT_EQ(map.totals().bytes, 0u);
}

// The build updates the file with the list of subvolumes when it begins a subvolume, even if no
// other event follows.
TEST(Subvolumes, AreListedWhileOneIsBuilt) {
  const TemporaryFolder folder;
  const std::string path = folder.file("subvolumes.json");
  ProgressPipe pipe(system_files(), path);
  pipe.set_subvolumes(1024, std::vector<SubvolumeStatus>{{7, {512, 0, 0}, 512, false, 0, 0, 0}});
  pipe.subvolume_begun(7);
  std::string text;
  for (int i = 0; i < 1000 && text.find("\"working\":[[512,0,0,512]]") == std::string::npos; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    text = read_small_file(system_files(), path, 1 << 20);
  }
  EXPECT_NE(text.find("\"working\":[[512,0,0,512]]"), std::string::npos) << text;
}

// ConfinedFiles opens no file outside its readable folders, neither through dots in a path nor
// through a symbolic link.
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
    EXPECT_THROW(files.open_own(folder.file(name)), Error);
  }
  EXPECT_EQ(files.open_own(folder.file("in/a"))->size(), 1u);
  std::filesystem::create_symlink(folder.file("in/a"), folder.file("public.glb"));
  EXPECT_THROW(files.open_own(folder.file("public.glb")), Error) << "a symbolic link";
  EXPECT_EQ(files.open_read(folder.file("public.glb"))->path(), folder.file("public.glb"))
      << "errors name the link, not its target";
  ConfinedFiles one(system_files(), {folder.file("in/a")});
  EXPECT_EQ(one.open_read(folder.file("in/a"))->size(), 1u);
  EXPECT_THROW(one.open_read(folder.file("in/side/b")), Error);
}

// The error for a file outside the readable folders is the same whether the file exists or not, and
// contains no path of the machine.
TEST(ConfinedFilesTest, DoesNotTellWhatIsOutside) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.file("in"));
  write_file_atomically(system_files(), folder.file("secret"), "x");
  write_file_atomically(system_files(), folder.file("in/a"), "x");
  ConfinedFiles files(system_files(), {folder.file("in/a")});
  const auto failure = [&](const std::string& path) {
    try {
      files.open_read(folder.file(path));
      return std::string("opened");
    } catch (const Error& error) {
      std::string text = error_name(error.code()) + (": " + error.message());
      const size_t at = text.find(folder.file(path));
      return at == std::string::npos ? text : text.replace(at, folder.file(path).size(), "PATH");
    }
  };
  const std::string outside = failure("in/../secret");
  EXPECT_NE(outside.find("is outside"), std::string::npos) << outside;
  for (const char* path : {"secret", "in/../missing", "missing", "in/b", "no/folder/x", "in/a/x"}) {
    SCOPED_TRACE(path);
    EXPECT_EQ(failure(path), outside);
  }
  EXPECT_EQ(failure("in/a"), "opened");
  std::filesystem::remove(folder.file("in/a"));
  EXPECT_NE(failure("in/a").find("not_found"), std::string::npos);
}

class JobOutcome : public testing::Test {
 protected:
  JobOutcome() {
    job_.state = JobState::kRunning;
    job_.attempts = 1;
  }
  void fail(const char* code) { live_.apply(Failure{code, ""}); }
  void apply(ChildProcess::End end = {}) { apply_outcome(job_, live_, end, limits_, 1000); }

  JobLimits limits_;
  Job job_;
  LiveJob live_{0};
};

TEST_F(JobOutcome, ARunWithAResultSucceeds) {
  live_.apply(Result{"{}"});
  apply();
  EXPECT_EQ(job_.state, JobState::kSucceeded);
  EXPECT_EQ(job_.result, "{}");
  EXPECT_EQ(job_.finished_s, 1000);
}

TEST_F(JobOutcome, AFullDiskIsRetriedWithLongerPauses) {
  fail("no_space");
  apply();
  EXPECT_EQ(job_.state, JobState::kQueued);
  EXPECT_EQ(job_.not_before_s, 1000 + limits_.backoff_s);
  job_.state = JobState::kRunning;
  job_.attempts = 3;
  apply();
  EXPECT_EQ(job_.not_before_s, 1000 + 4 * limits_.backoff_s);
  job_.state = JobState::kRunning;
  job_.attempts = limits_.max_attempts;
  apply();
  EXPECT_EQ(job_.state, JobState::kFailed);
  EXPECT_TRUE(job_.error->transient);
}

TEST_F(JobOutcome, ABrokenSceneFailsAtOnce) {
  fail("invalid_input");
  apply();
  EXPECT_EQ(job_.state, JobState::kFailed);
  EXPECT_FALSE(job_.error->transient);
}

TEST_F(JobOutcome, ACrashIsReported) {
  apply({0, SIGSEGV});
  EXPECT_EQ(job_.state, JobState::kFailed);
  EXPECT_EQ(job_.error->code, "internal");
  job_.state = JobState::kRunning;
  apply({0, SIGKILL});
  EXPECT_EQ(job_.error->code, "out_of_memory");
}

// If the service stops a job's process, and the process ends before it reports an outcome, the job
// counts as stopped, not as failed.
TEST_F(JobOutcome, AProcessThatWasStoppedAtOnceRunsAgain) {
  live_.stop();
  for (const ChildProcess::End& end :
       {ChildProcess::End{0, SIGTERM}, ChildProcess::End{128 + SIGTERM, 0},
        ChildProcess::End{0, SIGKILL}, ChildProcess::End{}}) {
    job_.state = JobState::kRunning;
    apply(end);
    EXPECT_EQ(job_.state, JobState::kQueued);
    EXPECT_FALSE(job_.error);
  }
}

TEST_F(JobOutcome, AStoppedRunGetsTheStateThatWasAskedFor) {
  live_.stop();
  fail("canceled");
  apply();
  EXPECT_EQ(job_.state, JobState::kQueued) << "the service stops";
  EXPECT_TRUE(job_.front);
  EXPECT_FALSE(job_.error);
  job_.state = JobState::kCanceling;
  apply();
  EXPECT_EQ(job_.state, JobState::kCanceled);
  job_.state = JobState::kSuspended;
  apply();
  EXPECT_EQ(job_.state, JobState::kSuspended);
}

// `interruptions` counts runs of a job during which the service ended. It is reset when a run ends
// by itself, with any outcome, because the job then was not the cause.
TEST_F(JobOutcome, ForgetsInterruptions) {
  job_.interruptions = 4;
  fail("no_space");
  apply();
  EXPECT_EQ(job_.interruptions, 0u);
}

}  // namespace
}  // namespace voxdag::server
