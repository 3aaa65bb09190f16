// A client of the API of `voxdag serve` (docs/api.md). It sends JSON requests, and repeats them
// while the server restarts or is busy. If an answer does not conform to docs/api.md, the functions
// throw nlohmann's json::exception. Used by one thread.
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

  // Sends a request that can safely be sent twice. Repeats the request while the server is busy
  // (status 408, 429, 502 to 504), as long as RetryPolicy (retry_policy.h) allows. If an earlier
  // request of this client was answered, also repeats the request while the server cannot be
  // reached. Throws an Error for any other status of 400 or above.
  using Request = std::function<ClientResponse(HttpClient& http)>;
  ClientResponse send_with_retries(const Request& request);

  Json get(const std::string& path);
  Json post(const std::string& path, const Json& body, const HeaderMap& headers = {});
  // Deletes a resource. Returns false if the service deletes it later.
  bool remove(const std::string& path);
  // Returns the id of the job whose id begins with `text`. Throws Error: kInvalidInput if `text` is
  // not hexadecimal or several ids begin with it, kNotFound if none does.
  std::string full_id(const std::string& text);
  // Returns a job as the JSON object that docs/api.md calls JOB.
  Json job(const std::string& id);
  // Performs an action on a job: "cancel", "suspend", "resume" or "retry". Returns the JOB after
  // the action.
  Json post_action(const std::string& id, const std::string& action);
  // Fetches the JOB twice per second and calls on_job(JOB) each time, until the job has ended.
  // Returns the last JOB. Throws Error{kCanceled} if cancel() is canceled; the job itself
  // continues.
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
