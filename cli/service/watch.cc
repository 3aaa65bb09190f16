#include <cstdio>

#include "cli/output.h"
#include "cli/service/follow.h"
#include "cli/service/job_text.h"

namespace voxdag::cli {
namespace {

struct WatchCommand {
  ServiceOptions service;
  std::string id;
  bool quiet = false;
  bool json = false;
};

void run(const WatchCommand& command, ServiceClient& service, CommandContext&) {
  const Json job = follow_job(service, command.id, command.quiet);
  if (command.json) print_json(job);
  check_succeeded(job);
  if (!command.json && !command.quiet) print_result(job);
}

void declare(Command& command, WatchCommand& state) {
  command.option("id", state.id, "job id").required();
  state.service.declare(command);
  command.quiet_flag(state.quiet);
  command.json_flag(state.json, "the job as one JSON object on standard output");
}

}  // namespace

void add_watch_command(CommandLine& line) {
  add_service_command<WatchCommand>(line, "watch", "follow a job of a server until it ends");
}

}  // namespace voxdag::cli
