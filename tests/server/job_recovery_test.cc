// Regression tests for defects that lost results of jobs, or left jobs in a state that never
// ended.
#include <condition_variable>
#include <csignal>
#include <filesystem>

#include "core/db/sqlite.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

class JobRecovery : public RunningService {
 protected:
  ~JobRecovery() override {
    release();
    stop();  // before_step uses members of this class
  }

  std::string data(const std::string& name) { return config_.data_folder + "/" + name; }
  void edit_queue(const std::string& sql) {
    SqlDatabase(data("queue.db"), SqlDatabase::Mode::kReadWrite).execute(sql);
  }
  // Makes the service run this script instead of voxdag for jobs and plans.
  void use_program(const std::string& script) {
    write_file_atomically(system_files(), folder_.file("program"), "#!/bin/sh\n" + script + "\n");
    std::filesystem::permissions(folder_.file("program"), std::filesystem::perms::owner_all);
    config_.program = folder_.file("program");
  }
  std::string posted_job() {
    put_scene("m.glb", scene_bytes());
    return post_job({{"scene", "m.glb"}, {"resolution", 64}});
  }
  ClientResponse act(const std::string& id, const std::string& action) {
    return post("/api/v1/jobs/" + id + "/" + action);
  }
  ClientResponse delete_job(const std::string& id) {
    return http_->send("DELETE", "/api/v1/jobs/" + id, "");
  }

  // Blocks the first step of the service whose name starts with `beginning`, until release(). With
  // `when_armed`, ignores steps before arm().
  void hold_step(const std::string& beginning, bool when_armed = false) {
    armed_ = !when_armed;
    config_.before_step = [this, beginning](const std::string& step) {
      std::unique_lock lock(mutex_);
      if (held_ || !armed_ || !step.starts_with(beginning)) return;
      held_ = true;
      changed_.notify_all();
      changed_.wait(lock, [this] { return free_; });
    };
  }
  void arm() {
    std::lock_guard lock(mutex_);
    armed_ = true;
  }
  void until_held() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return held_; });
  }
  void release() {
    std::lock_guard lock(mutex_);
    free_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool armed_ = true, held_ = false, free_ = false;
};

// If the deletion of a job fails halfway, the next service completes it. Until then the job cannot
// be retried, because the deletion would also remove the new results.
TEST_F(JobRecovery, AJobWhoseDeletionFailedIsNotTriedAgain) {
  start();
  const std::string id = posted_job();
  ASSERT_TRUE(until_state(id, "succeeded"));
  edit_queue("UPDATE job SET state = 4, result = ''");
  edit_queue("CREATE TRIGGER broken BEFORE DELETE ON job BEGIN SELECT RAISE(ABORT, 'broken'); END");
  EXPECT_EQ(delete_job(id).status, 500);
  EXPECT_EQ(not_problem(act(id, "retry"), 409, "conflict"), "");
  EXPECT_EQ(job(id)["state"], "canceled");
  // The job is still listed. Its files are gone, and requests for them are not internal errors.
  EXPECT_EQ(http_->get("/api/v1/jobs/" + id + "/log").status, 200);
  for (const char* part : {"/dag", "/report", "/preview.png", "/subvolumes", "/partial"})
    EXPECT_EQ(http_->get("/api/v1/jobs/" + id + part).status, 404) << part;
  edit_queue("DROP TRIGGER broken");
  stop();
  start();
  EXPECT_TRUE(until([&] { return http_->get("/api/v1/jobs/" + id).status == 404; }));
  EXPECT_TRUE(until([&] { return log().find("job " + id + " deleted") != std::string::npos; }));
  EXPECT_FALSE(std::filesystem::exists(data("jobs/" + id + ".deleted")));
}

// A job that succeeded is deleted, but the deletion fails halfway. Its result is gone, although the
// job is still listed.
TEST_F(JobRecovery, AResultWhoseDeletionFailedIsNotFound) {
  start();
  const std::string id = posted_job();
  ASSERT_TRUE(until_state(id, "succeeded"));
  edit_queue("CREATE TRIGGER broken BEFORE DELETE ON job BEGIN SELECT RAISE(ABORT, 'broken'); END");
  EXPECT_EQ(delete_job(id).status, 500);
  for (const char* part : {"/dag", "/report", "/preview.png", "/subvolumes", "/tiles"})
    EXPECT_EQ(http_->get("/api/v1/jobs/" + id + part).status, 404) << part;
  edit_queue("DROP TRIGGER broken");
  EXPECT_EQ(delete_job(id).status, 204);
  EXPECT_EQ(http_->get("/api/v1/jobs/" + id).status, 404);
}

// At its start, the service deletes folders of jobs that an earlier deletion has marked. It keeps a
// new folder and the record of the same job.
TEST_F(JobRecovery, AMarkedFolderTakesNoOtherAlong) {
  start();
  const std::string id = posted_job(), waiting = posted_job();
  ASSERT_TRUE(until_state(id, "succeeded"));
  ASSERT_TRUE(until_state(waiting, "succeeded"));
  stop();
  for (const std::string& job : {id, waiting}) {
    std::filesystem::create_directories(data("jobs/" + job + ".deleted/work"));
    write_file_atomically(system_files(), data("jobs/" + job + ".deleted/result.vdag"), "old");
  }
  std::filesystem::remove_all(data("jobs/" + waiting));
  edit_queue("UPDATE job SET state = 2 WHERE id = '" + waiting + "'");
  start();
  EXPECT_TRUE(until([&] {
    return !std::filesystem::exists(data("jobs/" + id + ".deleted")) &&
           !std::filesystem::exists(data("jobs/" + waiting + ".deleted"));
  }));
  EXPECT_EQ(job(id)["state"], "succeeded");
  EXPECT_EQ(http_->get("/api/v1/jobs/" + id + "/dag").status, 200);
  EXPECT_EQ(job(waiting)["state"], "suspended") << "the record of a backup, perhaps";
  EXPECT_NE(log().find("the job is kept"), std::string::npos) << log();
  EXPECT_EQ(delete_job(id).status, 204);
  EXPECT_EQ(act(waiting, "cancel").status, 202);
  EXPECT_EQ(delete_job(waiting).status, 204);
}

// A scene cannot be deleted while a dry run reads it.
TEST_F(JobRecovery, ASceneIsNotDeletedDuringADryRun) {
  use_program("until test -e " + folder_.file("go") + R"(; do sleep 0.1; done
echo '{"json":"{\"triangles\":1}","message":"result"}')");
  start();
  put_scene("m.glb", scene_bytes());
  const auto plans = [&] {
    return std::distance(std::filesystem::directory_iterator(data("plans")), {});
  };
  std::thread plan([this] {
    HttpClient client(ClientOptions{url(), "", "", 300});
    const Json body = {{"scene", "m.glb"}, {"resolution", 64}};
    const ClientResponse answer = client.send("POST", "/api/v1/jobs?dry_run=true", body.dump());
    EXPECT_EQ(answer.status, 200) << answer.body;
  });
  EXPECT_TRUE(until([&] { return std::filesystem::exists(data("plans")) && plans() == 1; }));
  EXPECT_EQ(not_problem(http_->send("DELETE", "/api/v1/scenes/m.glb", ""), 409, "conflict"), "");
  EXPECT_EQ(put_scene("m.glb", scene_bytes()).status, 200) << "it may be replaced";
  write_file_atomically(system_files(), folder_.file("go"), "");
  plan.join();
  EXPECT_EQ(http_->send("DELETE", "/api/v1/scenes/m.glb", "").status, 204);
}

// A retry is refused for the same reasons as a new job, such as a missing scene.
TEST_F(JobRecovery, AJobWithoutItsSceneIsNotTriedAgain) {
  use_program("exec sleep 600");
  start();
  const std::string id = posted_job();
  EXPECT_EQ(act(id, "cancel").status, 202);
  EXPECT_TRUE(until_state(id, "canceled"));
  EXPECT_EQ(http_->send("DELETE", "/api/v1/scenes/m.glb", "").status, 204);
  EXPECT_EQ(not_problem(act(id, "retry"), 404, "not_found"), "");
  EXPECT_EQ(job(id)["state"], "canceled");
  put_scene("m.glb", scene_bytes());
  EXPECT_EQ(act(id, "retry").status, 202);
  EXPECT_EQ(not_problem(http_->send("DELETE", "/api/v1/scenes/m.glb", ""), 409, "conflict"), "");
}

// A damaged record of one job does not make the list of jobs invalid JSON.
TEST_F(JobRecovery, AListWithADamagedRequestIsJson) {
  use_program("exec sleep 600");
  start();
  const std::string id = posted_job();
  EXPECT_EQ(act(id, "cancel").status, 202);
  EXPECT_TRUE(until_state(id, "canceled"));
  for (const char* request : {"{}", "{\"scene\":[\"m.glb\"]} ", "[]", "{"}) {
    edit_queue("UPDATE job SET request = '" + std::string(request) + "'");
    const ClientResponse list = http_->get("/api/v1/jobs");
    const Json body = Json::parse(list.body, nullptr, false);
    ASSERT_TRUE(body.is_object()) << list.body;
    EXPECT_EQ(body["jobs"][0]["id"], id);
    EXPECT_EQ(body["jobs"][0]["resolution"], 0);
  }
}

// While the thread of a suspended run still cleans up, the job can be canceled and deleted: the run
// has recorded its outcome and does not change the job any more.
TEST_F(JobRecovery, ASuspendedJobIsCanceledWhileItsThreadEnds) {
  use_program("exec sleep 600");
  hold_step("remove the work folder of job");
  start();
  const std::string id = posted_job();
  ASSERT_TRUE(until_state(id, "running"));
  EXPECT_EQ(act(id, "suspend").status, 202);
  until_held();
  const ClientResponse answer = act(id, "cancel");
  EXPECT_EQ(Json::parse(answer.body)["state"], "canceled") << answer.body;
  EXPECT_EQ(delete_job(id).status, 204);
  release();
}

TEST_F(JobRecovery, AJobThatWaitsForAnotherAttemptIsCanceledToo) {
  use_program(R"(echo '{"code":"io","message":"failure","text":"broken"}')");
  hold_step("remove the work folder of job");
  start();
  const std::string id = posted_job();
  until_held();
  ASSERT_EQ(job(id)["state"], "queued");
  const ClientResponse answer = act(id, "cancel");
  EXPECT_EQ(Json::parse(answer.body)["state"], "canceled") << answer.body;
  EXPECT_EQ(delete_job(id).status, 204);
  release();
}

// The partial output of an interrupted merge can be large.
TEST_F(JobRecovery, ACanceledJobKeepsNoPartialOutput) {
  use_program("exec sleep 600");
  start();
  const std::string id = posted_job();
  ASSERT_TRUE(until_state(id, "running"));
  EXPECT_EQ(act(id, "suspend").status, 202);
  const std::string partial = data("jobs/" + id + "/result.vdag.partial");
  write_file_atomically(system_files(), partial, "merged levels");
  ASSERT_TRUE(until([&] { return log().find("job " + id + " suspended") != std::string::npos; }));
  EXPECT_TRUE(std::filesystem::exists(partial));
  EXPECT_EQ(act(id, "cancel").status, 202);
  EXPECT_TRUE(until([&] { return !std::filesystem::exists(partial); }));
}

// A job is suspended after its process was requested but before the process runs the job's program.
// In this time the process has the service's handler of SIGTERM, so the signal alone would be lost.
// Nevertheless the job stops.
TEST_F(JobRecovery, AJobThatIsSuspendedAsItsProcessIsMadeDoesNotRunOn) {
  use_program(R"(sleep 1; echo '{"json":"{}","message":"result"}')");
  hold_step("run job ");
  const auto before = std::signal(SIGTERM, [](int) {});  // as `voxdag serve` does
  start();
  const std::string id = posted_job();
  until_held();
  EXPECT_EQ(act(id, "suspend").status, 202);
  release();
  const std::string line = "job " + id + " s";
  EXPECT_TRUE(until([&] { return log().find(line) != std::string::npos; }));
  EXPECT_EQ(job(id)["state"], "suspended");
  std::signal(SIGTERM, before);
}

// A stopping service starts no more jobs. It would have to wait for the end of such a job, because
// it has already stopped all jobs.
TEST_F(JobRecovery, AServiceThatStopsStartsNoOtherJob) {
  use_program("exec sleep 10");
  config_.jobs.max_concurrent = 2;
  hold_step("start jobs", true);
  start();
  const std::string running = posted_job();
  ASSERT_TRUE(until_state(running, "running"));
  arm();
  until_held();
  const std::string next = posted_job();
  begin_stop();
  EXPECT_TRUE(until([&] { return log().find("job " + running + " queued") != std::string::npos; }));
  release();
  stop();
  EXPECT_EQ(log().find("job " + next + " running"), std::string::npos);
}

}  // namespace
}  // namespace voxdag::server
