// Regression tests for defects that ended the service, lost files, or let one client block all
// others.
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <regex>
#include <set>
#include <stdexcept>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/db/sqlite.h"
#include "core/format/checksum.h"
#include "server/base/request_error.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

class ServiceFailures : public RunningService {
 protected:
  std::string data(const std::string& name) { return config_.data_folder + "/" + name; }
  int port() { return std::stoi(url().substr(url().rfind(':') + 1)); }
  bool is_alive() { return http_->get("/healthz").status == 200; }
  void edit_queue(const std::string& sql) {
    SqlDatabase(data("queue.db"), SqlDatabase::Mode::kReadWrite).execute(sql);
  }
  // Runs a small job until it succeeds, and returns its id.
  std::string finished_job() {
    put_scene("m.glb", scene_bytes());
    const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
    EXPECT_TRUE(until_state(id, "succeeded"));
    return id;
  }
};

// Each step of the service and each handler throws when it first runs, with exceptions of different
// types. The service continues to run and completes the job.
TEST_F(ServiceFailures, NoFailureEndsTheService) {
  std::mutex mutex;
  std::set<std::string> failed;
  config_.retention.finished_jobs = 0;
  injects_statuses_ = true;
  config_.before_step = [&](const std::string& step) {
    const std::string name = std::regex_replace(step, std::regex("[0-9a-f]{16}"), "ID");
    std::lock_guard lock(mutex);
    if (!failed.insert(name).second) return;
    switch (failed.size() % 5) {
      case 0:
        throw std::runtime_error("injected");
      case 1:
        throw Error(ErrorCode::kIo, "injected");
      case 2:
        throw RequestError(RequestError::Kind::kNotFound, "injected");
      case 3:
        throw std::bad_alloc();
      default:
        throw 1;
    }
  };
  start();
  const std::string bytes = scene_bytes();
  EXPECT_TRUE(until([&] { return put_scene("m.glb", bytes).status / 100 == 2; }));
  std::string id;
  EXPECT_TRUE(until([&] {
    const ClientResponse posted = post("/api/v1/jobs", {{"scene", "m.glb"}, {"resolution", 64}});
    if (posted.status == 202) id = Json::parse(posted.body)["id"];
    return posted.status == 202;
  }));
  EXPECT_TRUE(until([&] { return http_->get("/healthz").status == 200; }));
  EXPECT_TRUE(until_state(id, "succeeded"));
  EXPECT_TRUE(until([&] {
    std::lock_guard lock(mutex);
    return failed.contains("record a preview");
  }));
  // One of these calls of DELETE gets an injected error, so the status is not checked.
  EXPECT_TRUE(until([&] {
    http_->send("DELETE", "/api/v1/jobs/" + id, "");
    return http_->get("/api/v1/jobs/" + id).status == 404;
  }));
  stop();
  for (const char* step :
       {"recover the jobs", "dispatch jobs", "end the threads of jobs", "start jobs", "run job ID",
        "record how job ID ended", "remove the work folder of job ID", "draw a preview",
        "record a preview", "remove old jobs", "remove old uploads", "restore the ballast",
        "answer PUT", "answer POST", "answer GET", "answer DELETE"})
    EXPECT_TRUE(failed.contains(step)) << step;
}

// All steps fail repeatedly, as on a broken disk. Requests are still answered, and the job waits in
// the queue. When the steps work again, the job runs.
TEST_F(ServiceFailures, StepsMayFailForEver) {
  std::atomic<bool> fails{true};
  config_.before_step = [&](const std::string& step) {
    if (fails && !step.starts_with("answer")) throw std::logic_error("injected");
  };
  start();
  ASSERT_EQ(put_scene("m.glb", scene_bytes()).status, 201);
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
  usleep(500'000);
  EXPECT_EQ(job(id)["state"], "queued");
  fails = false;
  EXPECT_TRUE(until_state(id, "succeeded"));
  EXPECT_NE(log().find("failed to dispatch jobs: injected"), std::string::npos) << log();
}

// A client deletes a job after the retention rule has selected it for removal. This causes no
// error.
TEST_F(ServiceFailures, RetentionMeetsADeletion) {
  config_.retention.finished_jobs = 0;
  std::atomic<bool> deleted = false;
  config_.before_step = [&](const std::string& step) {
    if (!step.starts_with("remove old job ")) return;
    edit_queue("DELETE FROM job");
    deleted = true;
  };
  start();
  const std::string id = finished_job();
  stop();
  start();
  EXPECT_TRUE(until([&] { return deleted.load(); }));
  EXPECT_TRUE(until([&] { return http_->get("/api/v1/jobs/" + id).status == 404; }));
  EXPECT_TRUE(is_alive());
  EXPECT_EQ(log().find("failed to remove old job"), std::string::npos) << log();
}

// A job that another version of the program has queued cannot be read and fails. The next job runs.
TEST_F(ServiceFailures, AJobThatCannotBeReadFails) {
  start();
  const std::string first = finished_job(), second = finished_job();
  stop();
  edit_queue(
      "UPDATE job SET state = 0, request = '{\"scene\":[\"m.glb\"],\"resolution\":64,"
      "\"options\":{\"new_option\":1}}' WHERE id = '" +
      first + "'");
  edit_queue("UPDATE job SET state = 0 WHERE id = '" + second + "'");
  start();
  EXPECT_TRUE(until_state(second, "succeeded"));
  EXPECT_EQ(job(first)["state"], "failed");
  EXPECT_NE(job(first)["error"]["message"].get<std::string>().find("new_option"),
            std::string::npos);
  EXPECT_EQ(Json::parse(http_->get("/api/v1/jobs").body)["jobs"].size(), 2u);
}

// If the queue's database is missing or empty, the service does not start, and removes no file.
// With --adopt, it starts and recreates the records of the jobs from their files.
TEST_F(ServiceFailures, ALostQueueCostsNothing) {
  start();
  const std::string id = finished_job();
  const std::string dag = http_->get("/api/v1/jobs/" + id + "/dag").body;
  stop();
  for (const bool empty : {false, true}) {
    for (const char* suffix : {"", "-wal", "-shm"})
      std::filesystem::remove(data("queue.db") + suffix);
    if (empty) write_file_atomically(system_files(), data("queue.db"), "");
    for (int i = 0; i < 2; ++i) {
      try {
        start();
        ADD_FAILURE() << "started";
      } catch (const Error& error) {
        EXPECT_NE(error.message().find("--adopt"), std::string::npos) << error.message();
      }
    }
    EXPECT_TRUE(std::filesystem::exists(data("jobs/" + id + "/result.vdag")));
  }
  config_.adopt = true;
  start();
  EXPECT_EQ(job(id)["state"], "succeeded");
  EXPECT_EQ(job(id)["result"]["sha256"], sha256_hex(dag));
  EXPECT_EQ(http_->get("/api/v1/jobs/" + id + "/dag").body, dag);
  EXPECT_EQ(post_job({{"scene", "m.glb"}, {"resolution", 16}}).size(), 16u);
  stop();
  config_.adopt = false;
  start();
  EXPECT_EQ(http_->get("/api/v1/jobs/" + id + "/dag").body, dag);
}

// Somebody removes the files of a job. The answers name the job and the file.
TEST_F(ServiceFailures, NamesRemovedFiles) {
  start();
  const std::string id = finished_job(), path = "/api/v1/jobs/" + id;
  ASSERT_TRUE(until([&] { return http_->get(path + "/preview.png").status == 200; }));
  const Json request = {{"to", "npz"}};
  const std::string made =
      Json::parse(post(path + "/exports", request).body).at("links").at("self");
  ASSERT_TRUE(until([&] { return http_->get(made + "/files/0").status == 200; }));
  for (const char* file : {"result.vdag", "result.vdag.report.json", "preview.png"})
    std::filesystem::remove(data("jobs/" + id + "/" + file));
  std::filesystem::remove(
      config_.data_folder + made.substr(std::string("/api/v1").size()) + "/" +
      Json::parse(http_->get(made).body)["files"][0]["name"].get<std::string>());
  const auto expect = [&](const std::string& url, const std::string& name) {
    const ClientResponse answer = http_->get(url);
    EXPECT_EQ(not_problem(answer, 404, "not_found"), "") << url;
    EXPECT_NE(answer.body.find(name + " of the job " + id + " was removed"), std::string::npos)
        << answer.body;
  };
  expect(path + "/dag", "the result");
  expect(path + "/tiles", "the result");
  expect(path + "/report", "the report");
  expect(path + "/preview.png", "the preview");
  EXPECT_EQ(not_problem(http_->get(made + "/files/0"), 404, "not_found"), "");
  EXPECT_NE(http_->get(made + "/files/0").body.find("of the export "), std::string::npos);
}

// If the queue is lost, a job without a result is adopted as suspended. When it is resumed, it
// succeeds.
TEST_F(ServiceFailures, AnUnfinishedJobIsAdopted) {
  start();
  const std::string id = finished_job();
  stop();
  for (const char* name : {"queue.db", "queue.db-wal", "queue.db-shm"})
    std::filesystem::remove(data(name));
  for (const char* name : {"result.vdag", "result.vdag.report.json", "preview.png"})
    std::filesystem::remove(data("jobs/" + id + "/" + name));
  config_.adopt = true;
  start();
  EXPECT_EQ(job(id)["state"], "suspended");
  EXPECT_EQ(post("/api/v1/jobs/" + id + "/resume").status, 202);
  EXPECT_TRUE(until_state(id, "succeeded"));
}

// At its start, the service removes only files that it marked when it began to delete them.
TEST_F(ServiceFailures, ForeignFilesAreLeftAlone) {
  start();
  const std::string intact = finished_job(), deleted = finished_job();
  stop();
  const std::vector<std::string> foreign = {"jobs/README",
                                            "jobs/lost+found/x/precious",
                                            "jobs/0123456789abcdef/result.vdag",
                                            "jobs/backup.deleted/x",
                                            "plans/notes/x",
                                            "scenes/files/README"};
  for (const std::string& name : foreign) {
    std::filesystem::create_directories(std::filesystem::path(data(name)).parent_path());
    write_file_atomically(system_files(), data(name), "x");
  }
  std::filesystem::rename(data("jobs/" + deleted), data("jobs/" + deleted + ".deleted"));
  start();
  EXPECT_TRUE(is_alive());
  for (const std::string& name : foreign) EXPECT_TRUE(std::filesystem::exists(data(name))) << name;
  EXPECT_EQ(job(intact)["state"], "succeeded");
  EXPECT_TRUE(until([&] { return http_->get("/api/v1/jobs/" + deleted).status == 404; }))
      << "its deletion had begun";
  EXPECT_FALSE(std::filesystem::exists(data("jobs/" + deleted + ".deleted")));
  EXPECT_NE(log().find("lost+found"), std::string::npos) << log();
}

TEST_F(ServiceFailures, DeleteDuringUploadIsRefused) {
  start();
  const std::string bytes = scene_bytes();
  for (const bool replaces : {false, true}) {
    if (replaces) put_scene("m.glb", bytes);
    const int socket = raw_connect(port());
    const std::string head =
        "PUT /api/v1/scenes/m.glb HTTP/1.1\r\nHost: localhost\r\nConnection: "
        "close\r\nContent-Length: " +
        std::to_string(bytes.size()) + "\r\n\r\n" + bytes.substr(0, 1000);
    ASSERT_EQ(send(socket, head.data(), head.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(head.size()));
    // Waits until the upload is recorded, because before that the upload can be deleted.
    ASSERT_TRUE(
        until([&] { return http_->head("/api/v1/scenes/m.glb").header("Upload-Offset") == "0"; }));
    EXPECT_EQ(not_problem(http_->send("DELETE", "/api/v1/scenes/m.glb", ""), 409, "conflict"), "");
    const std::string rest = bytes.substr(1000);
    for (size_t at = 0; at < rest.size();) {
      const ssize_t sent = send(socket, rest.data() + at, rest.size() - at, MSG_NOSIGNAL);
      ASSERT_GT(sent, 0);
      at += static_cast<size_t>(sent);
    }
    char answer[13] = {};
    EXPECT_EQ(recv(socket, answer, 12, MSG_WAITALL), 12);
    EXPECT_EQ(std::string(answer), replaces ? "HTTP/1.1 200" : "HTTP/1.1 201");
    close(socket);
    EXPECT_EQ(Json::parse(http_->get("/api/v1/scenes/m.glb").body)["sha256"], sha256_hex(bytes));
    EXPECT_TRUE(std::filesystem::exists(data("scenes/files/m.glb")));
    EXPECT_EQ(http_->send("DELETE", "/api/v1/scenes/m.glb", "").status, 204);
    EXPECT_EQ(http_->send("DELETE", "/api/v1/scenes/m.glb", "").status, 404);
  }
}

TEST_F(ServiceFailures, AnUploadWhosePartIsLostStartsOver) {
  start();
  const std::string bytes = scene_bytes(), size = std::to_string(bytes.size());
  const auto part = [&](size_t first, size_t end) {
    return put_scene("m.glb", bytes.substr(first, end - first),
                     {{"Content-Range", "bytes " + std::to_string(first) + "-" +
                                            std::to_string(end - 1) + "/" + size}});
  };
  for (const bool removed : {true, false}) {
    EXPECT_EQ(part(0, 1000).status, 202);
    if (removed)
      std::filesystem::remove(data("scenes/parts/m.glb"));
    else
      std::filesystem::resize_file(data("scenes/parts/m.glb"), 999);
    const ClientResponse lost = part(1000, bytes.size());
    EXPECT_EQ(not_problem(lost, 409, "conflict"), "");
    EXPECT_EQ(lost.header("Upload-Offset"), "0");
  }
  EXPECT_EQ(part(0, bytes.size()).status, 201);
}

// One client cannot take all permits for transfers, so other clients are served.
TEST_F(ServiceFailures, LimitsOfOneClient) {
  config_.transfers.max_per_client = 1;
  start();
  const int socket = raw_connect(port());
  const std::string head =
      "PUT /api/v1/scenes/slow.glb HTTP/1.1\r\nHost: localhost\r\n"
      "Content-Length: 1000\r\n\r\nx";
  ASSERT_EQ(send(socket, head.data(), head.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(head.size()));
  ASSERT_TRUE(until([&] { return http_->head("/api/v1/scenes/slow.glb").status == 200; }));
  EXPECT_EQ(not_problem(put_scene("m.glb", "x"), 503, "busy"), "");
  close(socket);
  EXPECT_TRUE(until([&] { return put_scene("m.glb", "x").status == 201; }));
}

// If the client that requested a plan disconnects, the plan is stopped.
TEST_F(ServiceFailures, APlanEndsWithItsClient) {
  // Replaces the program that makes the plan with a script that takes longer than the test.
  write_file_atomically(system_files(), folder_.file("slow"), "#!/bin/sh\nexec sleep 600\n");
  std::filesystem::permissions(folder_.file("slow"), std::filesystem::perms::owner_all);
  config_.program = folder_.file("slow");
  config_.jobs.max_concurrent_plans = 1;
  start();
  put_scene("m.glb", "x");
  const std::string body = R"({"scene":"m.glb","resolution":64})";
  const int socket = raw_connect(port());
  const std::string request =
      "POST /api/v1/jobs?dry_run=true HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
      "application/json\r\nContent-Length: " +
      std::to_string(body.size()) + "\r\n\r\n" + body + "G";  // begin of another request
  ASSERT_EQ(send(socket, request.data(), request.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(request.size()));
  const auto plans = [&] {
    return std::distance(std::filesystem::directory_iterator(data("plans")), {});
  };
  ASSERT_TRUE(until([&] { return std::filesystem::exists(data("plans")) && plans() == 1; }));
  close(socket);
  const double start_s = wall_seconds();
  EXPECT_TRUE(until([&] { return plans() == 0; }));
  EXPECT_LT(wall_seconds() - start_s, config_.jobs.plan_timeout_s / 2);
  EXPECT_EQ(log().find("failed to"), std::string::npos) << log();
}

// A deeply nested JSON value in a request is refused. It does not end the service by a stack
// overflow.
TEST_F(ServiceFailures, ADeepValueIsNoPriority) {
  config_.transfers.max_body_bytes = 64 << 20;
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
  constexpr size_t kDepth = 300'000;
  const std::string deep = std::string(kDepth, '[') + std::string(kDepth, ']');
  const client::HeaderMap json = {{"Content-Type", "application/json"}};
  EXPECT_EQ(http_->send("PATCH", "/api/v1/jobs/" + id, "{\"priority\":" + deep + "}", json).status,
            400);
  for (const char* member : {"scene", "resolution", "options", "name"}) {
    SCOPED_TRACE(member);
    Json body = {{"scene", "m.glb"}, {"resolution", 64}};
    body.erase(member);
    std::string text = body.dump();
    text.insert(text.size() - 1, ",\"" + std::string(member) + "\":" + deep);
    EXPECT_EQ(http_->send("POST", "/api/v1/jobs", text, json).status, 400);
  }
  EXPECT_TRUE(is_alive());
}

// /readyz fails if the database of the queue or of the scenes is removed while the service runs.
TEST_F(ServiceFailures, ReadyzNoticesThatTheQueueIsGone) {
  start();
  put_scene("m.glb", scene_bytes());
  EXPECT_EQ(http_->get("/readyz").status, 200);
  for (const char* name : {"scenes/scenes.db", "queue.db"}) {
    SCOPED_TRACE(name);
    std::filesystem::rename(data(name), data("away"));
    EXPECT_EQ(http_->get("/readyz").status, 503);
    const int status = post("/api/v1/jobs", {{"scene", "m.glb"}, {"resolution", 64}}).status;
    EXPECT_EQ(status, std::string_view(name) == "queue.db" ? 500 : 202);
    std::filesystem::rename(data("away"), data(name));
    EXPECT_EQ(http_->get("/readyz").status, 200);
  }
}

// A clock that is far ahead for a while does not cause results to be deleted.
TEST_F(ServiceFailures, AClockThatJumpedDeletesNothing) {
  start();
  const std::string id = finished_job();
  stop();
  // Makes all times in the queue two years older, so that the clock seems to be two years ahead.
  edit_queue(
      "UPDATE job SET finished_s = finished_s - 63072000; "
      "UPDATE job_event SET at_s = at_s - 63072000");
  start();
  EXPECT_TRUE(until([&] { return log().find("the clock is far ahead") != std::string::npos; }));
  usleep(200'000);
  EXPECT_EQ(job(id)["state"], "succeeded");
  stop();
  // A recent event proves that the clock is right. So the job really is old, and is removed.
  edit_queue("UPDATE job_event SET at_s = at_s + 63072000");
  start();
  EXPECT_TRUE(until([&] { return http_->get("/api/v1/jobs/" + id).status == 404; }));
}

// If a service with tokens listens on the network without TLS, it logs a warning, because others
// can read the tokens.
TEST_F(ServiceFailures, WarnsOfTokensInPlainText) {
  const NewToken admin = make_token("admin", "a");
  write_file_atomically(system_files(), folder_.file("tokens"), admin.line + "\n");
  config_.token_file = folder_.file("tokens");
  start();
  EXPECT_EQ(log().find("plain text"), std::string::npos) << "the loopback is safe";
  stop();
  config_.http.address = "0.0.0.0";
  start();
  EXPECT_NE(log().find("plain text"), std::string::npos);
}

}  // namespace
}  // namespace voxdag::server
