#include "tests/server/running_service.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>

#include "core/base/clock.h"

namespace voxdag::server {
namespace {

constexpr double kMaxWaitS = 600;

}  // namespace

RunningService::RunningService() {
  config_.http.port = 0;
  config_.data_folder = folder_.file("data");
  config_.program = VOXDAG_BINARY;
  config_.jobs.min_free_disk_bytes = 0;
  config_.jobs.memory_bytes = uint64_t{1} << 30;
  config_.jobs.threads = 2;
  config_.jobs.nice = 0;
}

RunningService::~RunningService() {
  stop();
  if (!injects_statuses_) {
    EXPECT_EQ(log_.find("the OpenAPI document lacks"), std::string::npos) << log_;
  }
}

void RunningService::start() {
  service_ = std::make_unique<Service>(config_, *files_, [this](const LogEntry& entry) {
    std::lock_guard lock(log_mutex_);
    log_ += entry.message + "\n";
    if (entry.level == LogLevel::kError) error_log_ += entry.message + "\n";
  });
  thread_ = std::thread([this] { service_->run(); });
  http_ = std::make_unique<HttpClient>(ClientOptions{service_->url(), "", "", 300});
}

void RunningService::stop() {
  http_.reset();
  if (service_) service_->stop();
  if (thread_.joinable()) thread_.join();
  service_.reset();
}

std::string RunningService::log() {
  std::lock_guard lock(log_mutex_);
  return log_;
}

std::string RunningService::error_log() {
  std::lock_guard lock(log_mutex_);
  return error_log_;
}

std::string RunningService::scene_bytes() {
  const std::string path = folder_.file("menger.glb");
  if (!system_files().exists(path)) {
    const std::string command =
        std::string(VOXDAG_BINARY) + " generate menger " + path + " 2>&1 >/dev/null";
    EXPECT_EQ(std::system(command.c_str()), 0);
  }
  return read_small_file(system_files(), path, uint64_t{1} << 30);
}

ClientResponse RunningService::put_scene(const std::string& name, const std::string& bytes,
                                         const client::HeaderMap& headers) {
  return http_->upload(
      "/api/v1/scenes/" + name, bytes.size(),
      [&](uint64_t offset, uint64_t max_bytes) { return bytes.substr(offset, max_bytes); },
      headers);
}

ClientResponse RunningService::post(const std::string& path, const Json& body,
                                    const client::HeaderMap& headers) {
  return http_->send("POST", path, body.is_null() ? "" : body.dump(), headers);
}

std::string RunningService::post_job(const Json& body) {
  const ClientResponse response = post("/api/v1/jobs", body);
  EXPECT_EQ(response.status, 202) << response.body;
  if (response.status != 202) return "";
  const std::string id = Json::parse(response.body).at("id");
  EXPECT_EQ(response.header("Location"), "/api/v1/jobs/" + id);
  return id;
}

Json RunningService::job(const std::string& id) {
  const ClientResponse response = http_->get("/api/v1/jobs/" + id);
  EXPECT_EQ(response.status, 200) << response.body;
  return Json::parse(response.body);
}

bool RunningService::until(const std::function<bool()>& condition) {
  const double deadline = wall_seconds() + kMaxWaitS;
  while (!condition()) {
    if (wall_seconds() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

bool RunningService::until_state(const std::string& id, const std::string& state) {
  Json last;
  const bool reached = until([&] {
    last = job(id);
    return last["state"] == state || last["state"] == "failed";
  });
  EXPECT_EQ(last["state"], state) << last.dump(2);
  return reached && last["state"] == state;
}

std::string RunningService::not_problem(const ClientResponse& response, int status,
                                        const std::string& code) {
  const Json body = Json::parse(response.body, nullptr, false);
  if (response.status == status && body.is_object() && body.value("code", "") == code &&
      body.value("status", 0) == status &&
      response.header("Content-Type") == "application/problem+json")
    return "";
  return std::to_string(response.status) + " " + response.body;
}

int raw_connect(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  EXPECT_EQ(connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  return socket;
}

std::string raw_exchange(int port, const std::string& bytes) {
  const int socket = raw_connect(port);
  EXPECT_EQ(send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(bytes.size()));
  shutdown(socket, SHUT_WR);
  std::string answer;
  char piece[4096];
  for (pollfd waiting{socket, POLLIN, 0}; poll(&waiting, 1, 30000) > 0;) {
    const ssize_t got = recv(socket, piece, sizeof piece, 0);
    if (got <= 0) break;
    answer.append(piece, static_cast<size_t>(got));
  }
  close(socket);
  return answer;
}

}  // namespace voxdag::server
