#include <cstdio>
#include <memory>

#include "cli/service/follow.h"
#include "cli/service/job_text.h"

namespace voxdag::cli {
namespace {

struct WatchCommand {
  ServiceOptions service;
  std::string id;
  bool json = false;
};

void run(const WatchCommand& command, ServiceClient& service) {
  const Json job = follow_job(service, command.id);
  if (command.json) std::printf("%s\n", job.dump().c_str());
  check_succeeded(job);
  if (!command.json) print_result(job);
}

}  // namespace

void add_watch_command(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("watch", "follow a job of a server until it ends");
  const auto state = std::make_shared<WatchCommand>();
  command->add_option("id", state->id, "job id")->required();
  state->service.declare(*command);
  command->add_flag("--json", state->json, "the job as one JSON object on standard output");
  command->callback([state, &context] {
    state->service.with_service(context, [&](ServiceClient& service) { run(*state, service); });
  });
}

}  // namespace voxdag::cli
