#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "client/http_client.h"
#include "core/base/text/printable.h"

namespace voxdag::cli {
namespace {

struct HealthCommand {
  std::string url = "http://127.0.0.1:8080";
  std::string ca_file;
  unsigned timeout_s = 3;
  bool json = false;
};

void declare(Command& command, HealthCommand& state) {
  command.option("--server", state.url, "http://HOST:PORT of a `voxdag serve`")
      .environment("VOXDAG_SERVER")
      .show_default();
  command.option("--ca-file", state.ca_file, "certificates to trust instead of the system's");
  command.option("--timeout", state.timeout_s, "seconds to connect, and again for the answer")
      .positive()
      .show_default();
  command.json_flag(state.json);
}

void run(const HealthCommand& command, CommandContext&) {
  client::ClientOptions options;
  options.url = command.url;
  options.ca_file = command.ca_file;
  options.timeout_s = command.timeout_s;
  const client::ClientResponse answer = client::HttpClient(options).get("/readyz");
  client::throw_if_problem(answer);
  if (answer.status != 200 || answer.body.find("\"ready\"") == std::string::npos)
    throw Error(ErrorCode::kIo, "server " + command.url + ": /readyz answers with status " +
                                    std::to_string(answer.status) +
                                    ", expected 200 and \"ready\", as a voxdag service answers");
  if (command.json)
    return print_json(nlohmann::ordered_json{{"server", command.url}, {"ready", true}});
  std::printf("%s: ready\n", printable_line(command.url).c_str());
}

}  // namespace

void add_health_command(CommandLine& line) {
  add_command<HealthCommand>(line, "health", "ask a service whether it can accept jobs");
}

}  // namespace voxdag::cli
