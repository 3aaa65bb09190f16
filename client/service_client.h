// The API of `voxdag serve` (docs/api.md): JSON requests that are retried while the server restarts
// or is busy. Used by one thread. If an answer differs from docs/api.md, the functions throw
// nlohmann's json::exception.
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
  // 502 to 504). After the first answered request, also retries while the server cannot be reached.
  // Throws the Error of any other status from 400.
  using Request = std::function<ClientResponse(HttpClient& http)>;
  ClientResponse send_with_retries(const Request& request);

  Json get(const std::string& path);
  Json post(const std::string& path, const Json& body, const HeaderMap& headers = {});
  // Returns the JOB.
  Json job(const std::string& id);
  // Posts an action ("cancel", "suspend", "resume", "retry"). Returns the resulting JOB.
  Json post_action(const std::string& id, const std::string& action);
  // Calls on_job(JOB) twice per second until the job has ended, and returns the JOB. Throws
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

// Returns "/api/v1/jobs/ID". Throws Error{kInvalidInput} unless the id is 16 hex digits.
std::string job_path(const std::string& id);
// True if a JOB is in a final state: succeeded, failed or canceled.
bool has_ended(const Json& job);

}  // namespace voxdag::client
