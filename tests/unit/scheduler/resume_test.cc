#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <thread>

#include "core/base/error.h"
#include "core/format/artifact/segment_writer.h"
#include "core/io/forwarding_files.h"
#include "scheduler/replaced_result.h"
#include "scheduler/run_build.h"
#include "scheduler/spec/build_report.h"
#include "scheduler/state/build_locks.h"
#include "scheduler/state/job_status.h"
#include "scheduler/state/job_store.h"
#include "scheduler/state/work_folder.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/interruptions.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag {
namespace {

class ResumeTest : public testing::Test {
 protected:
  void SetUp() override { write_spheres(scene(), 20000); }
  std::string scene() const { return folder_.path() + "/scene.glb"; }
  std::string output() const { return folder_.path() + "/out.vdag"; }
  std::string work() const { return output() + ".work"; }

  BuildSpec spec() const { return spheres_build(scene(), output()); }
  static BuildReport build(const BuildSpec& spec) {
    NoProgress progress;
    return build(spec, progress);
  }
  static BuildReport build(const BuildSpec& spec, Progress& progress) {
    CancelToken cancel;
    return run_build(spec, {system_files(), progress, cancel});
  }
  static ErrorCode code_of(const BuildSpec& spec) {
    try {
      build(spec);
    } catch (const Error& error) {
      return error.code();
    }
    ADD_FAILURE() << "the build went through";
    return ErrorCode::kIo;
  }

  TemporaryFolder folder_;
};

// Records for each stage: the units of work that were done when it began, the units done so far,
// and the total.
class StageRecord : public NoProgress {
 public:
  struct Stage {
    uint64_t resumed_at = 0, done = 0, total = 0;
  };
  std::map<std::string, Stage> stages;

  void begin_stage(std::string_view stage, uint64_t total, std::string_view) override {
    const std::lock_guard lock(mutex_);
    now_ = &stages[std::string(stage)];
    *now_ = {0, 0, total};
  }
  void resume_at(uint64_t done) override {
    const std::lock_guard lock(mutex_);
    now_->resumed_at = now_->done = done;
  }
  void advance(uint64_t count) override {
    const std::lock_guard lock(mutex_);
    now_->done += count;
  }
  void set_total(uint64_t total) override {
    const std::lock_guard lock(mutex_);
    now_->total = total;
  }

 private:
  std::mutex mutex_;
  Stage* now_ = nullptr;
};

TEST_F(ResumeTest, ProgressIsThatOfTheWholeBuild) {
  BuildSpec often = spec();
  often.run.checkpoint_interval_s = 0;
  StageRecord whole;
  build(often, whole);
  std::filesystem::remove(output());
  for (const std::string stage : {"build", "merge"}) {
    SCOPED_TRACE(stage);
    build_until(often, stage, whole.stages.at(stage).total * 9 / 10);
    StageRecord resumed;
    build(often, resumed);
    std::filesystem::remove(output());
    EXPECT_GT(resumed.stages.at(stage).resumed_at, 0u);
    for (const auto& [name, end] : resumed.stages) {
      EXPECT_EQ(end.done, end.total) << name;
      EXPECT_EQ(end.total, whole.stages.at(name).total) << name;
    }
    EXPECT_EQ(resumed.stages.contains("build"), stage == "build");
  }
}

// The same call resumes a build that was canceled in any stage. It reuses the built subvolumes,
// gives the same bytes, and then removes the work folder.
TEST_F(ResumeTest, ResumesAfterAnInterruptionInAnyStage) {
  const std::string expected = build(spec()).sha256;
  std::filesystem::remove(output());
  struct Moment {
    const char* stage;
    uint64_t after;
    enum { kNothing, kSome, kAll } reused;
  };
  for (const Moment& moment :
       {Moment{"scan", 1, Moment::kNothing}, Moment{"ingest", 1, Moment::kNothing},
        Moment{"build", 1, Moment::kSome}, Moment{"build", 40, Moment::kSome},
        Moment{"merge", 0, Moment::kAll}, Moment{"merge", 1, Moment::kAll}}) {
    SCOPED_TRACE(std::string(moment.stage) + " after " + std::to_string(moment.after));
    build_until(spec(), moment.stage, moment.after);
    const BuildReport report = build(spec());
    EXPECT_EQ(report.sha256, expected);
    EXPECT_EQ(report.subvolumes_reused > 0, moment.reused != Moment::kNothing);
    EXPECT_EQ(report.subvolumes_reused == report.subvolumes, moment.reused == Moment::kAll);
    EXPECT_FALSE(std::filesystem::exists(work()));
    std::filesystem::remove(output());
  }
}

// A build that reorders the nodes also resumes after an interruption in build, merge or reorder. In
// such a build, the merge writes a separate file, from which the stage `reorder` makes the output.
// This file is removed at the end even if the work folder is kept.
TEST_F(ResumeTest, ResumesABuildThatReordersTheNodes) {
  BuildSpec ordered = spec();
  ordered.geometry.order = OrderName::kFirstParent;
  ordered.run.checkpoint_interval_s = 0;
  ordered.run.keep_work = true;
  const BuildReport whole = build(ordered);
  EXPECT_EQ(whole.node_order, OrderName::kFirstParent);
  const auto has_name = [](const StageTime& stage) { return stage.name == "reorder"; };
  EXPECT_EQ(std::ranges::count_if(whole.stages, has_name), 1);
  const std::string merged = work() + "/merged.vdag.partial";
  EXPECT_FALSE(std::filesystem::exists(merged));
  for (const auto& [stage, after] : {std::pair("build", 5), std::pair("merge", 1),
                                     std::pair("reorder", 0), std::pair("reorder", 1)}) {
    SCOPED_TRACE(stage);
    std::filesystem::remove(output());
    std::filesystem::remove_all(work());
    build_until(ordered, stage, static_cast<uint64_t>(after));
    EXPECT_EQ(std::filesystem::exists(merged), std::string(stage) == "reorder");
    StageRecord resumed;
    EXPECT_EQ(build(ordered, resumed).sha256, whole.sha256);
    EXPECT_EQ(resumed.stages.at("merge").resumed_at > 0, std::string(stage) == "reorder");
    EXPECT_FALSE(std::filesystem::exists(merged));
  }
}

// If the merge's file is damaged, the next run merges the intact artifacts again.
TEST_F(ResumeTest, MergesAgainIfTheFileToReorderIsDamaged) {
  BuildSpec ordered = spec();
  ordered.geometry.order = OrderName::kFirstParent;
  ordered.run.checkpoint_interval_s = 0;
  const std::string expected = build(ordered).sha256;
  std::filesystem::remove(output());
  build_until(ordered, "reorder", 0);
  const std::string merged = work() + "/merged.vdag.partial";
  {
    std::fstream file(merged, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(merged) / 2));
    file.write("damage", 6);
  }
  EXPECT_EQ(build(ordered).sha256, expected);
}

// A build with a different scene, resolution or number of hash bits does not resume the job in the
// work folder: it fails, and the error names the difference. With `restart`, it starts over. A
// build with different run options (RunOptions) resumes the job.
TEST_F(ResumeTest, RefusesAnotherJobInTheSameFolder) {
  build_until(spec(), "build", 5);
  BuildSpec other = spec();
  other.geometry.resolution = 512;
  EXPECT_EQ(code_of(other), ErrorCode::kInvalidInput);
  other = spec();
  other.geometry.hash_bits = 16;
  EXPECT_EQ(code_of(other), ErrorCode::kInvalidInput);
  std::filesystem::copy(scene(), folder_.path() + "/second.glb");
  other = spec();
  other.geometry.scenes.push_back(folder_.path() + "/second.glb");
  EXPECT_EQ(code_of(other), ErrorCode::kInvalidInput);
  other = spec();
  other.geometry.hash_bits = 16;
  other.run.restart = true;
  EXPECT_EQ(build(other).subvolumes_reused, 0u);

  std::filesystem::remove(output());
  build_until(spec(), "build", 5);
  other = spec();
  other.run.threads = 2;
  other.run.memory_bytes = uint64_t{64} << 20;
  other.run.subvolume_edge = 64;
  const BuildReport report = build(other);
  EXPECT_GT(report.subvolumes_reused, 0u);
  EXPECT_GT(report.subvolumes_split, 0u);
  other.run = spec().run;
  EXPECT_EQ(report.sha256, build(other).sha256);
}

// Only the subvolumes of a damaged or missing segment are built again.
TEST_F(ResumeTest, RebuildsDamagedArtifacts) {
  const std::string expected = build(spec()).sha256;
  for (const bool whole_segment : {false, true}) {
    SCOPED_TRACE(whole_segment ? "segment removed" : "byte flipped");
    std::filesystem::remove(output());
    build_until(spec(), "merge", 0);
    const std::string segment = segment_path(work(), 0);
    if (whole_segment) {
      std::filesystem::remove(segment);
    } else {
      std::fstream file(segment, std::ios::in | std::ios::out | std::ios::binary);
      const auto middle = static_cast<std::streamoff>(std::filesystem::file_size(segment) / 2);
      file.seekg(middle);
      const char byte = static_cast<char>(file.get() ^ 0x10);
      file.seekp(middle);
      file.put(byte);
    }
    const BuildReport report = build(spec());
    EXPECT_EQ(report.sha256, expected);
    EXPECT_LT(report.subvolumes_reused, report.subvolumes);
    EXPECT_EQ(report.subvolumes_reused + (whole_segment ? report.subvolumes : 1),
              report.subvolumes);
  }
}

// A second build in the same work folder fails, and its error names the process of the first. A
// work folder that also contains a file of another program is refused, and the file is kept.
TEST_F(ResumeTest, OwnsItsFolderAlone) {
  {
    CancelToken cancel;
    NoProgress progress;
    WorkFolder first({system_files(), progress, cancel}, work(), 0);
    BuildSpec second = spec();
    second.run.lock_wait_s = 0.1;
    try {
      build(second);
      FAIL() << "two builds in one folder";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kIo);
      EXPECT_NE(error.message().find("process " + std::to_string(getpid())), std::string::npos)
          << error.what();
    }
    EXPECT_NE(WorkFolder::holder(system_files(), work()), "");
  }
  EXPECT_EQ(WorkFolder::holder(system_files(), work()), "");
  std::ofstream(work() + "/letter.txt") << "not ours";
  EXPECT_EQ(code_of(spec()), ErrorCode::kInvalidInput);
  EXPECT_TRUE(std::filesystem::exists(work() + "/letter.txt"));
}

// If the path of the work folder is a folder of another program, the build fails and does not
// change this folder.
TEST_F(ResumeTest, RefusesAForeignFolderOfOurName) {
  std::filesystem::create_directories(work() + "/merge");
  std::ofstream(work() + "/merge/thesis.txt") << "not ours";
  EXPECT_EQ(code_of(spec()), ErrorCode::kInvalidInput);
  EXPECT_TRUE(std::filesystem::exists(work() + "/merge/thesis.txt"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(work()), {}), 1);
}

// `status` holds the lock of the work folder briefly. A build waits for it instead of failing.
TEST_F(ResumeTest, WaitsForThoseWhoLook) {
  std::filesystem::create_directories(work());
  auto looking = system_files().try_lock(work() + "/lock");
  ASSERT_TRUE(looking);
  std::thread looker([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    looking.reset();
  });
  const std::string sha256 = build(spec()).sha256;
  looker.join();
  EXPECT_EQ(sha256.size(), 64u);
}

// While one build holds the lock of an output, another build with another work folder cannot write
// this output. Afterwards the interrupted first build can be resumed.
TEST_F(ResumeTest, OwnsItsOutputAlone) {
  BuildSpec first = spec();
  first.run.work_folder = folder_.path() + "/first";
  build_until(first, "build", 5);
  {
    const OutputLock held(system_files(), output());
    BuildSpec second = spec();
    second.run.lock_wait_s = 0.1;
    EXPECT_EQ(code_of(second), ErrorCode::kIo);
    EXPECT_FALSE(std::filesystem::exists(work()));
  }
  EXPECT_FALSE(std::filesystem::exists(output() + ".partial"));
  EXPECT_GT(build(first).subvolumes_reused, 0u);
}

// A build whose merge has begun cannot be resumed with another output, because the merge continues
// in the output file that it has begun.
TEST_F(ResumeTest, KeepsTheOutputOfAMergeThatBegan) {
  BuildSpec checkpointed = spec();
  checkpointed.run.work_folder = folder_.path() + "/work";
  checkpointed.run.checkpoint_interval_s = 0;
  const std::string expected = build(checkpointed).sha256;
  std::filesystem::remove(output());
  build_until(checkpointed, "write", 0);
  BuildSpec elsewhere = checkpointed;
  elsewhere.run.output = folder_.path() + "/other.vdag";
  EXPECT_EQ(code_of(elsewhere), ErrorCode::kInvalidInput);
  EXPECT_EQ(build(checkpointed).sha256, expected);
}

// If a work folder cannot be created or written, the error names the folder, and no work is done.
TEST_F(ResumeTest, NeedsAFolderToWriteIn) {
  BuildSpec nowhere = spec();
  nowhere.run.work_folder = scene() + "/work";  // not a folder: its parent is a file
  try {
    build(nowhere);
    FAIL() << "built without a work folder";
  } catch (const Error& error) {
    EXPECT_NE(error.message().find(scene()), std::string::npos) << error.what();
  }
  EXPECT_FALSE(std::filesystem::exists(output() + ".partial"));
}

// A job store of another version of voxdag is refused, and so is a job of another version in a job
// store. The error names the version. With `restart`, the build starts over.
TEST_F(ResumeTest, RefusesAJobOfAnotherVersion) {
  const std::string expected = build(spec()).sha256;
  for (const bool of_store : {true, false}) {
    SCOPED_TRACE(of_store ? "version of the store" : "version of the job");
    std::filesystem::remove(output());
    build_until(spec(), "build", 5);
    const std::string store = work() + "/job.db";
    if (of_store) {
      SqlDatabase(store, SqlDatabase::Mode::kReadWrite).execute("PRAGMA user_version = 77");
    } else {
      JobStore jobs(store, JobStore::Access::kBuild);
      JobIdentity job = jobs.job().value();
      job.format_version = 77;
      jobs.start(job, {});
    }
    try {
      build(spec());
      ADD_FAILURE() << "the build went through";
    } catch (const Error& error) {
      EXPECT_NE(error.message().find("77"), std::string::npos) << error.what();
    }
    BuildSpec again = spec();
    again.run.restart = true;
    EXPECT_EQ(build(again).sha256, expected);
  }
}

// If a database of another program replaces the job store in a voxdag work folder, --restart starts
// over. If the folder contains only such a database, voxdag did not create the folder, and even
// --restart keeps the database.
TEST_F(ResumeTest, StartsOverInAFolderOfItsOwnOnly) {
  build_until(spec(), "build", 5);
  const std::string store = work() + "/job.db";
  SqlDatabase(store, SqlDatabase::Mode::kReadWrite).execute("PRAGMA application_id = 77");
  EXPECT_EQ(code_of(spec()), ErrorCode::kInvalidInput);
  BuildSpec again = spec();
  again.run.restart = true;
  EXPECT_EQ(build(again).subvolumes_reused, 0u);

  std::filesystem::create_directories(work());
  SqlDatabase(store, SqlDatabase::Mode::kReadWrite).execute("CREATE TABLE thesis (chapter)");
  EXPECT_EQ(code_of(again), ErrorCode::kInvalidInput);
  EXPECT_TRUE(std::filesystem::exists(store));
}

// The error of a canceled build explains how to resume the build.
TEST_F(ResumeTest, SaysHowToResume) {
  CancelToken cancel;
  CancelingProgress progress(cancel, "build", 5);
  try {
    run_build(spec(), {system_files(), progress, cancel});
    FAIL() << "the build was not interrupted";
  } catch (const Error& error) {
    EXPECT_TRUE(error.message().ends_with("; run the same command again to resume"))
        << error.what();
  }
}

// Ends the process without any cleanup when the output gets its final name.
class KillAtPublish : public ForwardingFiles {
 public:
  explicit KillAtPublish(const std::string& output)
      : ForwardingFiles(system_files()), output_(output) {}
  void rename(const std::string& from, const std::string& to) override {
    ForwardingFiles::rename(from, to);
    if (to == output_) _exit(0);
  }
  bool rename_new(const std::string& from, const std::string& to) override {
    const bool is_renamed = ForwardingFiles::rename_new(from, to);
    if (to == output_) _exit(0);
    return is_renamed;
  }

 private:
  const std::string output_;
};

// A short build that is killed between the renames of its output and of its report leaves no job
// store. The same command can still replace the output. A build of another scene is refused.
TEST_F(ResumeTest, AShortBuildMayReplaceTheOutputOfAKilledOne) {
  BuildSpec short_build = spec();
  short_build.run.checkpoint_interval_s = 1e9;
  const pid_t killed = fork();
  if (killed == 0) {
    KillAtPublish files(output());
    NoProgress progress;
    CancelToken cancel;
    run_build(short_build, {files, progress, cancel});
    _exit(1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(killed, &status, 0), killed);
  ASSERT_EQ(WEXITSTATUS(status), 0);
  EXPECT_TRUE(std::filesystem::exists(output()));
  EXPECT_FALSE(std::filesystem::exists(default_report_path(output())));
  EXPECT_FALSE(std::filesystem::exists(WorkFolder::store_path(work())));
  const auto bytes = std::filesystem::file_size(output());
  BuildSpec other = short_build;
  other.geometry.scenes = {folder_.path() + "/other.glb"};
  write_spheres(other.geometry.scenes[0], 1000, 2);
  EXPECT_THROW(refuse_result_of_other_scene(system_files(), other), Error);
  EXPECT_NO_THROW(refuse_result_of_other_scene(system_files(), short_build));
  EXPECT_EQ(build(short_build).bytes, bytes);
  EXPECT_TRUE(std::filesystem::exists(default_report_path(output())));
  EXPECT_FALSE(std::filesystem::exists(work()));
}

// A running build that has no job store yet has a status.
TEST_F(ResumeTest, ReportsThatABuildHasBegun) {
  EXPECT_THROW(read_job_status(system_files(), work()), Error);
  CancelToken cancel;
  NoProgress progress;
  const WorkFolder held({system_files(), progress, cancel}, work(), 0);
  const JobStatus status = read_job_status(system_files(), work());
  EXPECT_TRUE(status.running);
  EXPECT_EQ(status.subvolumes, 0u);
  EXPECT_NE(status_json(status, "").find("\"running\": true"), std::string::npos);
}

// Another process can read the state of an interrupted build.
TEST_F(ResumeTest, ReportsItsStatus) {
  EXPECT_THROW(read_job_status(system_files(), work()), Error);
  build_until(spec(), "build", 5);
  const JobStatus status = read_job_status(system_files(), work());
  EXPECT_FALSE(status.running);
  EXPECT_GE(status.built, 5u);
  EXPECT_GT(status.subvolumes, status.built);
  ASSERT_TRUE(status.progress.has_value());
  EXPECT_EQ(status.progress->stage, "build");
  EXPECT_NE(status.progress->last_error.find("canceled"), std::string::npos);
}

}  // namespace
}  // namespace voxdag
