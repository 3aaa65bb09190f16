// Tests webhooks with a local receiver.
#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <map>

#include "server/webhooks/webhook_message.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

struct Received {
  std::string target;
  std::string headers;
  std::string body;
  // Returns the value of a header field.
  std::string header(const std::string& name) const {
    const size_t at = headers.find("\r\n" + name + ": ");
    if (at == std::string::npos) return "";
    const size_t begin = at + name.size() + 4;
    return headers.substr(begin, headers.find("\r\n", begin) - begin);
  }
};

// An HTTP server that records requests. Each connection has a thread.
class Receiver {
 public:
  explicit Receiver(int port = 0) {
    socket_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int on = 1;
    setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(socket_, 64), 0);
    EXPECT_EQ(getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { accept_all(); });
  }
  ~Receiver() {
    stops_ = true;
    thread_.join();
    for (std::thread& thread : threads_) thread.join();
    close(socket_);
  }

  std::string url(const std::string& path = "") const {
    return "http://127.0.0.1:" + std::to_string(port_) + path;
  }
  // All connections get these bytes, and after them a zero byte every 20 ms, until they are closed.
  void begin_with(const std::string& bytes) {
    std::lock_guard lock(mutex_);
    beginning_ = bytes;
  }
  // The next requests get these answers; later requests get "204 No Content". The answer "" means
  // none: the connection stays open.
  void answer_with(std::vector<std::string> answers) {
    std::lock_guard lock(mutex_);
    answers_ = std::move(answers);
  }
  std::vector<Received> received() {
    std::lock_guard lock(mutex_);
    return received_;
  }

 private:
  void accept_all() {
    for (pollfd waiting{socket_, POLLIN, 0}; !stops_;) {
      if (poll(&waiting, 1, 20) <= 0) continue;
      const int connection = accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC);
      if (connection >= 0) threads_.emplace_back([this, connection] { serve(connection); });
    }
  }

  void serve(int connection) {
    if (send_slowly(connection)) return;
    std::string text;
    char piece[4096];
    pollfd waiting{connection, POLLIN, 0};
    size_t end = std::string::npos, size = 0;
    while (!stops_ && (end == std::string::npos || text.size() < end + 4 + size)) {
      if (poll(&waiting, 1, 20) <= 0) continue;
      const ssize_t got = recv(connection, piece, sizeof piece, 0);
      if (got <= 0) break;
      text.append(piece, static_cast<size_t>(got));
      end = text.find("\r\n\r\n");
      if (end == std::string::npos) continue;
      const Received head{"", text.substr(0, end + 2), ""};
      size = static_cast<size_t>(std::atoi(head.header("Content-Length").c_str()));
    }
    if (end != std::string::npos && text.size() >= end + 4 + size) {
      const std::string answer = record(text, end);
      if (answer.empty()) wait_for_close(waiting);
      const std::string reply = "HTTP/1.1 " + answer + "\r\nConnection: close\r\n\r\n";
      if (!answer.empty()) ::send(connection, reply.data(), reply.size(), MSG_NOSIGNAL);
    }
    close(connection);
  }

  std::string record(const std::string& text, size_t end) {
    std::lock_guard lock(mutex_);
    const size_t target = text.find(' ') + 1;
    received_.push_back({text.substr(target, text.find(' ', target) - target),
                         text.substr(0, end + 2), text.substr(end + 4)});
    if (answers_.empty()) return "204 No Content";
    const std::string answer = answers_.front();
    answers_.erase(answers_.begin());
    return answer;
  }

  bool send_slowly(int connection) {
    std::string piece;
    {
      std::lock_guard lock(mutex_);
      piece = beginning_;
    }
    if (piece.empty()) return false;
    while (!stops_ && ::send(connection, piece.data(), piece.size(), MSG_NOSIGNAL) > 0) {
      piece.assign(1, '\0');
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    close(connection);
    return true;
  }

  void wait_for_close(pollfd& waiting) const {
    char byte;
    while (!stops_ && (poll(&waiting, 1, 20) == 0 || recv(waiting.fd, &byte, 1, 0) > 0)) {
    }
  }

  int socket_ = -1;
  int port_ = 0;
  std::atomic<bool> stops_{false};
  std::thread thread_;
  std::vector<std::thread> threads_;  // used by thread_, then by the destructor
  std::mutex mutex_;                  // guards the members below
  std::string beginning_;
  std::vector<std::string> answers_;
  std::vector<Received> received_;
};

constexpr const char* kError = "500 Internal Server Error\r\nContent-Length: 0";

class WebhookService : public RunningService {
 protected:
  WebhookService() {
    config_.webhooks.allow = {receiver_.url("/hooks")};
    config_.webhooks.backoff_s = 0.01;
  }
  void start_with_scene() {
    start();
    ASSERT_EQ(put_scene("m.glb", scene_bytes()).status, 201);
  }
  std::string post_with(const std::string& webhook, const Json& more = Json::object()) {
    Json body = {{"scene", "m.glb"}, {"resolution", 64}, {"webhook", webhook}};
    body.update(more);
    return post_job(body);
  }
  // Waits until the newest delivery of the job is in this state, and returns the member "webhook".
  Json until_webhook(const std::string& id, const std::string& state) {
    Json webhook;
    EXPECT_TRUE(until([&] { return (webhook = job(id)["webhook"])["state"] == state; })) << webhook;
    return webhook;
  }
  // Waits until the log contains `text`. The service writes the line about an attempt after it has
  // recorded the attempt.
  testing::AssertionResult until_logged(const std::string& text) {
    if (until([&] { return log().find(text) != std::string::npos; }))
      return testing::AssertionSuccess();
    return testing::AssertionFailure() << "expected '" << text << "' in the log:\n" << log();
  }

  Receiver receiver_;
};

TEST_F(WebhookService, DeliversTheEndOfAJob) {
  const std::string secret = "a secret of a test";
  std::ofstream(folder_.file("secret")) << secret << "\n";
  config_.webhooks.secret_file = folder_.file("secret");
  start_with_scene();
  const std::string id =
      post_with(receiver_.url("/hooks/a?b=c"), {{"name", "n"}, {"labels", {"x", "y"}}});
  ASSERT_TRUE(until_state(id, "succeeded"));
  const Json webhook = until_webhook(id, "delivered");
  const auto received = receiver_.received();
  ASSERT_EQ(received.size(), 1u);
  EXPECT_EQ(received[0].target, "/hooks/a?b=c");
  EXPECT_EQ(received[0].header("Content-Type"), "application/json");
  EXPECT_EQ(received[0].header("X-Voxdag-Signature"), webhook_signature(secret, received[0].body));
  const Json body = Json::parse(received[0].body), ended = job(id);
  EXPECT_EQ(received[0].header("X-Voxdag-Delivery"), body["delivery"]);
  EXPECT_EQ(body["id"], id);
  EXPECT_EQ(body["name"], "n");
  EXPECT_EQ(body["labels"], Json({"x", "y"}));
  EXPECT_EQ(body["state"], "succeeded");
  EXPECT_EQ(body["error"], nullptr);
  EXPECT_EQ(body["result"]["sha256"], ended["result"]["sha256"]);
  EXPECT_EQ(body["result"]["bytes"], ended["result"]["bytes"]);
  EXPECT_EQ(webhook["delivery"], body["delivery"]);
  EXPECT_EQ(webhook["origin"], receiver_.url());
  EXPECT_EQ(webhook["attempts"], 1);
  EXPECT_EQ(webhook["status"], 204);
  EXPECT_EQ(webhook["error"], nullptr);
  EXPECT_EQ(webhook["next_attempt_at"], nullptr);
  EXPECT_EQ(ended.dump().find("/hooks"), std::string::npos) << "paths may contain secrets";

  EXPECT_EQ(job(post_job({{"scene", "m.glb"}, {"resolution", 16}}))["webhook"], nullptr);
}

// If an answer is not 2xx, the delivery is attempted again. Redirects are not followed. All
// attempts have the same body. After the last attempt, the delivery has failed.
TEST_F(WebhookService, RetriesUntilAReceiverAccepts) {
  config_.webhooks.max_attempts = 3;
  start_with_scene();
  receiver_.answer_with(
      {kError, "302 Found\r\nContent-Length: 0\r\nLocation: " + receiver_.url("/hooks/elsewhere")});
  const std::string id = post_with(receiver_.url("/hooks/a"));
  EXPECT_EQ(until_webhook(id, "delivered")["attempts"], 3);
  auto received = receiver_.received();
  ASSERT_EQ(received.size(), 3u);
  for (const Received& each : received) {
    EXPECT_EQ(each.target, "/hooks/a");
    EXPECT_EQ(each.body, received[0].body);
    EXPECT_EQ(each.header("X-Voxdag-Signature"), "") << "no secret is configured";
  }

  receiver_.answer_with({kError, kError, kError});
  ASSERT_EQ(post("/api/v1/jobs",
                 {{"scene", "m.glb"}, {"resolution", 32}, {"webhook", receiver_.url("/hooks/b")}})
                .status,
            202);
  const std::string failed = Json::parse(http_->get("/api/v1/jobs?limit=1").body)["jobs"][0]["id"];
  const Json webhook = until_webhook(failed, "failed");
  EXPECT_EQ(webhook["attempts"], 3);
  EXPECT_EQ(webhook["status"], 500);
  EXPECT_EQ(webhook["error"], "status 500: expected 200 to 299");
  EXPECT_EQ(receiver_.received().size(), 6u);
  const std::string ended = "; the delivery has failed, and there is no further attempt\n";
  EXPECT_TRUE(until_logged("attempt 3 of 3 failed: status 500: expected 200 to 299" + ended));
  EXPECT_NE(error_log().find("attempt 3 of 3"), std::string::npos) << log();
  EXPECT_TRUE(until_logged("attempt 2 of 3 failed: status 500: expected 200 to 299\n"));
  EXPECT_EQ(error_log().find("attempt 2 of 3"), std::string::npos);
  const std::string metrics = http_->get("/metrics").body;
  for (const char* line :
       {"voxdag_webhook_pending_deliveries 0\n", "voxdag_webhook_attempts_total 6\n",
        "voxdag_webhook_deliveries_total{state=\"delivered\"} 1\n"
        "voxdag_webhook_deliveries_total{state=\"failed\"} 1\n"})
    EXPECT_NE(metrics.find(line), std::string::npos) << line << "is not in\n" << metrics;
}

TEST_F(WebhookService, RefusesUrlsThatAreNotAllowed) {
  start_with_scene();
  const auto refused = [&](const std::string& url) {
    const Json body = {{"scene", "m.glb"}, {"resolution", 64}, {"webhook", url}};
    EXPECT_EQ(not_problem(post("/api/v1/jobs?dry_run=true", body), 400, "invalid_input"), "");
    const ClientResponse response = post("/api/v1/jobs", body);
    EXPECT_EQ(not_problem(response, 400, "invalid_input"), "");
    return response.body;
  };
  EXPECT_NE(refused(receiver_.url("/other")).find("webhooks.allow"), std::string::npos);
  EXPECT_NE(refused(receiver_.url("/hooks/../other")).find("segments"), std::string::npos);
  EXPECT_NE(refused("http://127.0.0.1/hooks").find("webhooks.allow"), std::string::npos);
  EXPECT_NE(refused("http://u:p@127.0.0.1/hooks").find("user name"), std::string::npos);
  stop();
  config_.webhooks.allow.clear();
  start();
  EXPECT_NE(refused(receiver_.url("/hooks")).find("allows none"), std::string::npos);
  EXPECT_EQ(receiver_.received().size(), 0u);
}

TEST_F(WebhookService, RefusesABadConfiguration) {
  const auto error = [&](const std::vector<std::string>& allow, const std::string& secret) {
    config_.webhooks.allow = allow;
    std::ofstream(folder_.file("secret")) << secret;
    config_.webhooks.secret_file = folder_.file("secret");
    try {
      start();
    } catch (const Error& e) {
      return e.message();
    }
    return std::string();
  };
  const std::string secret(16, 's');
  EXPECT_NE(error({"http://h/?a"}, secret).find("webhooks.allow: 'http://h/?a'"),
            std::string::npos);
  EXPECT_NE(error({"h"}, secret).find("webhooks.allow: 'h'"), std::string::npos);
  EXPECT_NE(error({"http://h"}, "short").find("at least 16"), std::string::npos);
  EXPECT_NE(error(std::vector<std::string>(65, "http://h"), secret).find("at most 64"),
            std::string::npos);
}

// A receiver that does not answer delays neither jobs nor deliveries to another receiver. The stop
// of the service ends the attempt, and the next service repeats it.
TEST_F(WebhookService, SurvivesASlowReceiverAndARestart) {
  Receiver other;
  config_.webhooks.allow.push_back(other.url());
  config_.webhooks.timeout_s = 300;
  start_with_scene();
  receiver_.answer_with(std::vector<std::string>(4));
  std::vector<std::string> slow;
  for (int i = 0; i < 4; ++i)
    slow.push_back(post_with(receiver_.url("/hooks/slow"), {{"resolution", 16 << i}}));
  for (const std::string& id : slow) ASSERT_TRUE(until_state(id, "succeeded"));
  const std::string fast = post_with(other.url("/fast"));
  EXPECT_EQ(until_webhook(fast, "delivered")["attempts"], 1);
  EXPECT_TRUE(until([&] { return receiver_.received().size() == 2; }));
  EXPECT_EQ(job(slow[3])["webhook"]["state"], "pending");
  stop();  // would take five minutes if it waited for the receiver
  EXPECT_EQ(receiver_.received().size(), 2u) << "at most two attempts per receiver";

  receiver_.answer_with({});
  start();
  for (const std::string& id : slow) EXPECT_EQ(until_webhook(id, "delivered")["attempts"], 1);
  EXPECT_EQ(receiver_.received().size(), 6u);
  EXPECT_EQ(other.received().size(), 1u) << "delivered before the restart";
}

TEST_F(WebhookService, EndsAttemptsAtTheDeadline) {
  config_.webhooks.timeout_s = 0.2;
  start_with_scene();
  receiver_.answer_with({""});
  const std::string id = post_with(receiver_.url("/hooks"));
  EXPECT_GE(until_webhook(id, "delivered")["attempts"], 2);
  EXPECT_TRUE(until_logged("attempt 1 of 10 failed: no answer within 0.2 s"));
}

// A TLS handshake that makes slow progress also ends at the deadline, and when the service stops.
TEST_F(WebhookService, EndsSlowHandshakes) {
  if (!client::supports_https()) GTEST_SKIP() << "the HTTP library of this build has no TLS";
  Receiver slow;
  slow.begin_with(std::string("\x16\x03\x03\x40\x00\x02\x00\x3f\x00", 9));  // a ServerHello
  const std::string url = "https" + slow.url("/a").substr(4);
  config_.webhooks.allow.push_back(url);
  config_.webhooks.timeout_s = 0.3;
  start_with_scene();
  const std::string id = post_with(url);
  EXPECT_TRUE(until([&] { return job(id)["webhook"]["attempts"] >= 2; }));
  const std::string fast = post_with(receiver_.url("/hooks"));
  EXPECT_EQ(until_webhook(fast, "delivered")["attempts"], 1);
  stop();
}

// A header line without an end does not fill the memory of the service until the deadline.
TEST_F(WebhookService, EndsAnswersThatAreTooLong) {
  Receiver endless;
  endless.begin_with("HTTP/1.1 204 No Content\r\nX-Long: " + std::string(400 << 10, 'x'));
  config_.webhooks.allow.push_back(endless.url());
  config_.webhooks.timeout_s = 300;
  start_with_scene();
  const std::string id = post_with(endless.url("/a"));
  EXPECT_TRUE(until([&] { return job(id)["webhook"]["attempts"] >= 1; }));
  EXPECT_TRUE(until_logged("attempt 1 of 10 failed: the answer has over 262144 bytes"));
}

// If the service is killed after it has recorded the end of a job, but before it has stored the
// delivery, the next service stores it. A third service delivers nothing again.
TEST_F(WebhookService, DeliversEndsThatAKilledServiceRecorded) {
  std::filesystem::create_directories(config_.data_folder);
  JobQueue queue(config_.data_folder + "/queue.db");
  const auto no_log = [](const LogEntry&) {};
  { Webhooks first(config_, system_files(), queue, no_log); }
  Job job;
  job.request = R"({"scene":["m.glb"],"resolution":64,"options":{},"webhook":")" +
                receiver_.url("/hooks") + "\"}";
  const std::string id = queue.add(job, {}, 10).job.id;
  queue.change(id, [](Job& j) { j.state = JobState::kCanceled; });
  for (int i = 0; i < 2; ++i) {
    Webhooks next(config_, system_files(), queue, no_log);
    ASSERT_TRUE(until(
        [&] { return Json::parse(next.job_member(*queue.find(id)))["state"] == "delivered"; }));
  }
  ASSERT_EQ(receiver_.received().size(), 1u);
  EXPECT_EQ(Json::parse(receiver_.received()[0].body)["state"], "canceled");
}

// A job that fails or is canceled is reported, and again after a retry. The deletion of a job
// cancels its deliveries.
TEST_F(WebhookService, ReportsEachEndOfAJob) {
  config_.jobs.max_concurrent = 1;
  config_.webhooks.backoff_s = 3600;
  start_with_scene();
  const std::string id = post_with(receiver_.url("/hooks"), {{"resolution", 65536}});
  ASSERT_EQ(post("/api/v1/jobs/" + id + "/suspend").status, 202);
  EXPECT_EQ(job(id)["webhook"]["state"], "waiting");
  for (size_t count = 1; count <= 2; ++count) {
    ASSERT_EQ(post("/api/v1/jobs/" + id + "/cancel").status, 202);
    ASSERT_TRUE(until([&] { return receiver_.received().size() == count; }));
    const Json body = Json::parse(receiver_.received().back().body);
    EXPECT_EQ(body["state"], "canceled");
    EXPECT_EQ(body["result"], nullptr);
    until_webhook(id, "delivered");
    if (count == 2) break;
    ASSERT_EQ(post("/api/v1/jobs/" + id + "/retry").status, 202);
    ASSERT_EQ(post("/api/v1/jobs/" + id + "/suspend").status, 202);
    EXPECT_EQ(job(id)["webhook"]["state"], "waiting");
  }
  receiver_.answer_with({kError});
  const std::string deleted = post_with(receiver_.url("/hooks/deleted"));
  ASSERT_TRUE(until([&] { return receiver_.received().size() == 3; }));
  ASSERT_TRUE(until([&] { return job(deleted)["webhook"]["attempts"] == 1; }));
  EXPECT_EQ(job(deleted)["webhook"]["state"], "pending");
  ASSERT_EQ(http_->send("DELETE", "/api/v1/jobs/" + deleted, "").status, 204);
  stop();
  start();
  EXPECT_EQ(receiver_.received().size(), 3u);
}

}  // namespace
}  // namespace voxdag::server
