#include "cli/service/service_client.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <thread>

namespace voxdag::cli {
namespace {

constexpr double kTimeout_s = 120;  // of silence: a whole scene may be looked at before an answer
constexpr double kLongestPause_s = 10;
constexpr double kMaxWait_s = 300;
constexpr double kStep_s = 0.05;  // between two looks at Ctrl-C
constexpr uint64_t kLargestToken = 4096;

void sleep_for(double seconds, const CancelToken& cancel) {
  for (; seconds > 0; seconds -= kStep_s) {
    cancel.check();
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(seconds, kStep_s)));
  }
  cancel.check();
}

std::string without_slash(std::string url) {
  while (url.ends_with('/')) url.pop_back();
  return url;
}

std::string trimmed(const std::string& text) {
  const char* const blank = " \t\r\n";
  const size_t first = text.find_first_not_of(blank);
  return first == std::string::npos ? ""
                                    : text.substr(first, text.find_last_not_of(blank) - first + 1);
}

}  // namespace

void ServerOptions::declare(CLI::App& command) {
  const char* group = "Server";
  command.add_option("--server", url_, "http://HOST:PORT of a `voxdag serve`")
      ->envname("VOXDAG_SERVER")
      ->required()
      ->group(group);
  command.add_option("--token-file", token_file_, "file with the bearer token, if one is needed")
      ->envname("VOXDAG_TOKEN_FILE")
      ->group(group);
  command.add_option("--ca-file", ca_file_, "certificates to trust instead of the system's")
      ->group(group);
}

client::ClientOptions ServerOptions::client_options(FileSystem& files) const {
  client::ClientOptions options;
  options.url = without_slash(url_);
  options.ca_file = ca_file_;
  options.timeout_s = kTimeout_s;
  if (!token_file_.empty()) {
    options.token = trimmed(read_small_file(files, token_file_, kLargestToken));
    const bool visible = std::all_of(options.token.begin(), options.token.end(),
                                     [](char c) { return c > ' ' && c <= '~'; });
    if (options.token.empty() || !visible)
      throw Error(ErrorCode::kInvalidInput, token_file_ + ": expected one token, on one line");
  }
  return options;
}

bool RetryPolicy::wait(double min_wait_s) {
  if (waited_s_ >= kMaxWait_s) return false;
  const double seconds = std::max(pause_s_, std::min(min_wait_s, kMaxWait_s));
  sleep_for(seconds, cancel_);
  waited_s_ += seconds;
  pause_s_ = std::min(kLongestPause_s, 2 * pause_s_);
  return true;
}

double retry_after_s(const client::ClientResponse& response) {
  switch (response.status) {
    case 408:
    case 429:
    case 502:
    case 503:
    case 504:
      break;
    default:
      return -1;
  }
  const std::string text = response.header("Retry-After");
  unsigned seconds = 0;
  std::from_chars(text.data(), text.data() + text.size(), seconds);
  return seconds;
}

std::string job_path(const std::string& id) {
  if (id.size() != 16 || id.find_first_not_of("0123456789abcdef") != std::string::npos)
    throw Error(ErrorCode::kInvalidInput, "job '" + id + "': expected an id of 16 hex digits");
  return "/api/v1/jobs/" + id;
}

Server::Server(const ServerOptions& options, CommandContext& context)
    : context_(context),
      url_(without_slash(options.url())),
      http_(options.client_options(context.files)) {}

client::ClientResponse Server::ask(const Request& request) {
  for (RetryPolicy patience(cancel());;) {
    cancel().check();
    client::ClientResponse response;
    try {
      response = request(http_);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kIo || !has_answered_ || !patience.wait()) throw;
      continue;
    }
    has_answered_ = true;
    const double wait_s = retry_after_s(response);
    if (wait_s >= 0 && patience.wait(wait_s)) continue;
    throw_if_problem(response);
    return response;
  }
}

Json Server::get(const std::string& path) {
  return Json::parse(ask([&](client::HttpClient& http) { return http.get(path); }).body);
}

Json Server::post(const std::string& path, const Json& body, const client::HeaderMap& headers) {
  const std::string text = body.dump();
  return Json::parse(
      ask([&](client::HttpClient& http) { return http.send("POST", path, text, headers); }).body);
}

Json Server::job(const std::string& id) { return get(job_path(id)); }

void Server::pause(double seconds) const { sleep_for(seconds, cancel()); }

void with_server(const ServerOptions& options, CommandContext& context,
                 const std::function<void(Server&)>& talk) {
  try {
    Server server(options, context);
    talk(server);
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kIo, "server " + options.url() +
                                    ": an answer that cannot be read: expected voxdag's API v1");
  }
}

}  // namespace voxdag::cli
