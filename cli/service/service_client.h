// A running `voxdag serve`, as the client commands talk to it: JSON in and out, and patience while
// it restarts or is busy.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "cli/command.h"
#include "client/http_client.h"

namespace voxdag::cli {

using Json = nlohmann::json;

// --server, --token-file and --ca-file, which all client commands have.
class ServerOptions {
 public:
  void declare(CLI::App& command);
  const std::string& url() const { return url_; }
  // Reads the token's file.
  client::ClientOptions client_options(FileSystem& files) const;

 private:
  std::string url_, token_file_, ca_file_;
};

// When to try again: after half a second, then longer and longer, for about five minutes in all.
class RetryPolicy {
 public:
  explicit RetryPolicy(const CancelToken& cancel) : cancel_(cancel) {}
  // Waits; false if it has been tried for long enough. Throws Error{kCanceled} on Ctrl-C.
  bool wait(double min_wait_s = 0);
  // Something went forward: from here it counts anew.
  void renew() { waited_s_ = 0, pause_s_ = kFirstPause_s; }

 private:
  static constexpr double kFirstPause_s = 0.5;
  const CancelToken& cancel_;
  double waited_s_ = 0, pause_s_ = kFirstPause_s;
};

class Server {
 public:
  Server(const ServerOptions& options, CommandContext& context);

  // The answer to a request that changes nothing when it is sent twice. Asked again while the
  // server is busy (408, 429, 502 to 504) and, once it has answered anything, while it cannot be
  // reached. Throws the Error of any other status from 400 up.
  using Request = std::function<client::ClientResponse(client::HttpClient& http)>;
  client::ClientResponse ask(const Request& request);

  Json get(const std::string& path);
  Json post(const std::string& path, const Json& body, const client::HeaderMap& headers = {});
  // A JOB. Throws Error{kInvalidInput} for an id that cannot be one.
  Json job(const std::string& id);

  client::HttpClient& http() { return http_; }
  const std::string& url() const { return url_; }
  FileSystem& files() { return context_.files; }
  const CancelToken& cancel() const { return context_.cancel; }
  // Sleeps; throws Error{kCanceled} on Ctrl-C.
  void pause(double seconds) const;

 private:
  CommandContext& context_;
  const std::string url_;
  client::HttpClient http_;
  bool has_answered_ = false;
};

// Seconds that a busy server asks to wait for, or -1 if the answer does not tell to come again.
double retry_after_s(const client::ClientResponse& response);
// "/api/v1/jobs/ID"; throws Error{kInvalidInput} unless the id is 16 hex digits.
std::string job_path(const std::string& id);

// Runs a command's talk with the server; an answer that is not as docs/api.md says is Error{kIo}.
void with_server(const ServerOptions& options, CommandContext& context,
                 const std::function<void(Server&)>& talk);

}  // namespace voxdag::cli
