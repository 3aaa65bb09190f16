// Runs the service in the process of the test, on a free port. Jobs run in separate processes.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "client/http_client.h"
#include "server/service.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {

using Json = nlohmann::json;
using client::ClientOptions;
using client::ClientResponse;
using client::HttpClient;

class RunningService : public testing::Test {
 protected:
  RunningService();
  // Expects that each answer of the service had a status that the OpenAPI document lists for its
  // route.
  ~RunningService() override;

  void start();
  void stop();
  // Stops the service as SIGTERM does. Any thread may call it.
  void begin_stop() { service_->stop(); }
  std::string url() const { return service_->url(); }

  // Returns a Menger sponge of 36 096 triangles.
  std::string scene_bytes();
  ClientResponse put_scene(const std::string& name, const std::string& bytes,
                           const client::HeaderMap& headers = {});
  ClientResponse post(const std::string& path, const Json& body = nullptr,
                      const client::HeaderMap& headers = {});
  // Posts a job, expects that it is accepted, and returns its id.
  std::string post_job(const Json& body);
  Json job(const std::string& id);
  // Polls the condition for up to ten minutes. Returns whether it became true.
  bool until(const std::function<bool()>& condition);
  bool until_state(const std::string& id, const std::string& state);
  // Returns "" if the answer is an error with this status and code; otherwise a description of the
  // answer.
  static std::string not_problem(const ClientResponse& response, int status,
                                 const std::string& code);
  std::string log();
  // Returns the lines of log() whose level is error.
  std::string error_log();

  TemporaryFolder folder_;
  ServerConfig config_;
  FileSystem* files_ = &system_files();
  bool injects_statuses_ = false;  // true: errors are injected, so any status is valid
  std::unique_ptr<HttpClient> http_;

 private:
  std::unique_ptr<Service> service_;
  std::thread thread_;
  std::mutex log_mutex_;
  std::string log_, error_log_;
};

// Sends raw bytes and reads until the server closes the connection, or is silent for 30 s.
std::string raw_exchange(int port, const std::string& bytes);
// Returns a connected socket.
int raw_connect(int port);

}  // namespace voxdag::server
