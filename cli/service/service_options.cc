#include "cli/service/service_options.h"

#include <algorithm>

namespace voxdag::cli {
namespace {

constexpr double kTimeout_s = 120;  // the server can check a complete scene before it answers
constexpr uint64_t kMaxTokenBytes = 4096;

std::string trimmed(const std::string& text) {
  const char* const space = " \t\r\n";
  const size_t first = text.find_first_not_of(space);
  return first == std::string::npos ? ""
                                    : text.substr(first, text.find_last_not_of(space) - first + 1);
}

}  // namespace

void ServiceOptions::declare(Command& command) {
  const char* group = "Server";
  command.option("--server", url_, "http://HOST:PORT of a `voxdag serve`")
      .environment("VOXDAG_SERVER")
      .required()
      .group(group);
  command.option("--token-file", token_file_, "file with the bearer token, if one is needed")
      .environment("VOXDAG_TOKEN_FILE")
      .group(group);
  command.option("--ca-file", ca_file_, "certificates to trust instead of the system's")
      .group(group);
}

client::ClientOptions ServiceOptions::client_options(FileSystem& files) const {
  client::ClientOptions options;
  options.url = url_;
  while (options.url.ends_with('/')) options.url.pop_back();
  options.ca_file = ca_file_;
  options.timeout_s = kTimeout_s;
  if (!token_file_.empty()) {
    options.token = trimmed(read_small_file(files, token_file_, kMaxTokenBytes));
    const bool visible = std::all_of(options.token.begin(), options.token.end(),
                                     [](char c) { return c > ' ' && c <= '~'; });
    if (options.token.empty() || !visible)
      throw Error(ErrorCode::kInvalidInput,
                  token_file_ +
                      (visible ? " is empty" : " has a space, line break or control character") +
                      ": expected one token, on one line");
  }
  return options;
}

void ServiceOptions::with_service(CommandContext& context,
                                  const std::function<void(ServiceClient&)>& action) const {
  try {
    ServiceClient service(client_options(context.files), context.cancel);
    action(service);
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kIo,
                "server " + url_ +
                    ": the answer is not an answer of the voxdag API: expected the voxdag API v1");
  }
}

}  // namespace voxdag::cli
