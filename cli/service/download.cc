#include <cstdio>
#include <memory>

#include "cli/service/fetch.h"
#include "core/base/text.h"

namespace voxdag::cli {
namespace {

struct DownloadCommand {
  ServerOptions server;
  std::string id, output;
  bool json = false;
};

void run(const DownloadCommand& command, Server& server) {
  const Fetched fetched = fetch_result(server, server.job(command.id), command.output);
  if (command.json) {
    const Json report = {{"output", command.output},
                         {"bytes", fetched.bytes},
                         {"resumed_at", fetched.resumed_at},
                         {"sha256", fetched.sha256}};
    std::printf("%s\n", report.dump().c_str());
  } else {
    std::printf("%s: %s, sha256 %s\n", command.output.c_str(), size_text(fetched.bytes).c_str(),
                fetched.sha256.c_str());
  }
}

}  // namespace

void add_download_command(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("download", "fetch the result of a server's job");
  const auto state = std::make_shared<DownloadCommand>();
  command->add_option("id", state->id, "the job's id")->required();
  command->add_option("-o,--output", state->output, "the .vdag file to make")->required();
  state->server.declare(*command);
  command->add_flag("--json", state->json, "report as one JSON object on standard output");
  command->callback([state, &context] {
    with_server(state->server, context, [&](Server& server) { run(*state, server); });
  });
}

}  // namespace voxdag::cli
