#include <cstdio>
#include <memory>

#include "cli/service/follow.h"
#include "cli/service/job_text.h"

namespace voxdag::cli {
namespace {

struct WatchCommand {
  ServerOptions server;
  std::string id;
  bool json = false;
};

void run(const WatchCommand& command, Server& server) {
  const Json job = follow_job(server, command.id);
  if (command.json) std::printf("%s\n", job.dump().c_str());
  check_succeeded(job);
  if (!command.json) print_result(job);
}

}  // namespace

void add_watch_command(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("watch", "follow a job of a server to its end");
  const auto state = std::make_shared<WatchCommand>();
  command->add_option("id", state->id, "the job's id")->required();
  state->server.declare(*command);
  command->add_flag("--json", state->json, "the job as one JSON object on standard output");
  command->callback([state, &context] {
    with_server(state->server, context, [&](Server& server) { run(*state, server); });
  });
}

}  // namespace voxdag::cli
