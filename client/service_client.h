// The API of a `voxdag serve` (docs/api.md): JSON requests that are retried while the server
// restarts or is busy. Used by one thread. Where an answer is not what docs/api.md says, nlohmann's
// json::exception comes through.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "client/http_client.h"
#include "voxdag/cancel_token.h"

namespace voxdag::client {

using Json = nlohmann::json;

class ServiceClient {
 public:
  ServiceClient(const ClientOptions& options, const CancelToken& cancel)
      : url_(options.url), cancel_(cancel), http_(options) {}

  // Sends a request that may safely be sent twice. Retries it while the server is busy (408, 429,
  // 502 to 504) and, once it has answered any request, while it cannot be reached. Throws the Error
  // of any other status from 400 up.
  using Request = std::function<ClientResponse(HttpClient& http)>;
  ClientResponse send_with_retries(const Request& request);

  Json get(const std::string& path);
  Json post(const std::string& path, const Json& body, const HeaderMap& headers = {});
  // Returns the JOB.
  Json job(const std::string& id);
  // Posts an action ("cancel", "suspend", "resume", "retry"); returns the JOB after it.
  Json post_action(const std::string& id, const std::string& action);
  // Calls on_job(JOB) twice per second until the job has ended, and returns it. Throws
  // Error{kCanceled} if the token is set; the job itself continues.
  Json follow_job(const std::string& id, const std::function<void(const Json& job)>& on_job);

  HttpClient& http() { return http_; }
  const std::string& url() const { return url_; }
  const CancelToken& cancel() const { return cancel_; }

 private:
  const std::string url_;
  const CancelToken& cancel_;
  HttpClient http_;
  bool has_answered_ = false;
};

// "/api/v1/jobs/ID"; throws Error{kInvalidInput} unless the id is 16 hex digits.
std::string job_path(const std::string& id);
// True if a JOB is in a final state: succeeded, failed or canceled.
bool has_ended(const Json& job);

}  // namespace voxdag::client
