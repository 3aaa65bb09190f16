#include "client/service_client.h"

#include "client/retry_policy.h"
#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "core/io/random_id.h"

namespace voxdag::client {
namespace {

constexpr double kPollIntervalS = 0.5;

std::string text_of(const Json& body) {
  try {
    return exact_json_text(body);
  } catch (const Json::type_error&) {
    throw Error(ErrorCode::kInvalidInput,
                "a name or path in the request " + ascii_json_text(body).substr(0, 200) +
                    " is not UTF-8 (\\ufffd marks the place): expected UTF-8");
  }
}

}  // namespace

ClientResponse ServiceClient::send_with_retries(const Request& request) {
  for (RetryPolicy retry(cancel_);;) {
    cancel_.check();
    ClientResponse response;
    try {
      response = request(http_);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kIo || !has_answered_ || !retry.wait()) throw;
      continue;
    }
    has_answered_ = true;
    const double wait_s = retry_after_s(response);
    if (wait_s >= 0 && retry.wait(wait_s)) continue;
    throw_if_problem(response);
    return response;
  }
}

Json ServiceClient::get(const std::string& path) {
  return parse_json<Json>(send_with_retries([&](HttpClient& http) { return http.get(path); }).body);
}

Json ServiceClient::post(const std::string& path, const Json& body, const HeaderMap& headers) {
  const std::string text = body.is_null() ? "" : text_of(body);
  return parse_json<Json>(send_with_retries([&](HttpClient& http) {
                            return http.send("POST", path, text, headers);
                          }).body);
}

bool ServiceClient::remove(const std::string& path) {
  return send_with_retries([&](HttpClient& http) {
           return http.send("DELETE", path, "");
         }).status != 202;
}

std::string ServiceClient::full_id(const std::string& text) {
  if (is_random_id(text)) return text;
  if (text.empty() || text.size() > 16 ||
      text.find_first_not_of("0123456789abcdef") != std::string::npos)
    throw Error(ErrorCode::kInvalidInput,
                "job '" + text + "': expected an id of 16 hex digits, or its first digits");
  std::string found;
  for (std::string cursor = "&limit=200"; !cursor.empty();) {
    const Json page = get("/api/v1/jobs?q=" + text + cursor);
    for (const Json& job : page.at("jobs")) {
      const std::string id = job.at("id");
      if (!id.starts_with(text)) continue;  // the text is in the job's name, scenes or labels
      if (!found.empty())
        throw Error(ErrorCode::kInvalidInput, "job '" + text + "': the ids " + found + " and " +
                                                  id + " begin with it: expected more digits");
      found = id;
    }
    const Json& next = page.at("next_cursor");
    cursor = next.is_string() ? "&limit=200&cursor=" + next.get<std::string>() : "";
  }
  if (found.empty())
    throw Error(ErrorCode::kNotFound,
                "job '" + text + "': no id begins with it: expected the id of an existing job");
  return found;
}

Json ServiceClient::job(const std::string& id) { return get(job_path(id)); }

Json ServiceClient::post_action(const std::string& id, const std::string& action) {
  return post(job_path(id) + "/" + action, nullptr);
}

Json ServiceClient::follow_job(const std::string& id,
                               const std::function<void(const Json& job)>& on_job) {
  try {
    for (;; sleep_for(kPollIntervalS, cancel_)) {
      Json state = job(id);
      on_job(state);
      if (has_ended(state)) return state;
    }
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCanceled) throw;
    throw Error(ErrorCode::kCanceled, "no longer watching job " + id + ", which continues");
  }
}

std::string job_path(const std::string& id) {
  if (!is_random_id(id))
    throw Error(ErrorCode::kInvalidInput, "job '" + id + "': expected an id of 16 hex digits");
  return "/api/v1/jobs/" + id;
}

bool has_ended(const Json& job) {
  const std::string state = job.at("state");
  return state == "succeeded" || state == "failed" || state == "canceled";
}

}  // namespace voxdag::client
