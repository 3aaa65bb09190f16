// The commands cancel, suspend and resume: one action on one or more jobs.
#include <cstdio>
#include <vector>

#include "cli/output.h"
#include "cli/service/job_text.h"
#include "cli/service/service_options.h"

namespace voxdag::cli {
namespace {

struct JobActionCommand {
  std::string action;  // "cancel", "suspend" or "resume"
  ServiceOptions service;
  std::vector<std::string> ids;
  bool json = false;
};

void declare(Command& command, JobActionCommand& state) {
  command.option("id", state.ids, "job id; several may be given").required();
  state.service.declare(command);
  command.json_flag(state.json, "each job as one JSON object on one line of standard output");
}

// Performs the action on each job. For a failed or canceled job, "resume" requests a retry.
void run(const JobActionCommand& command, ServiceClient& service, CommandContext&) {
  for (const std::string& id : command.ids) {
    const std::string state = command.action == "resume" ? service.job(id).at("state") : "";
    const bool ended = state == "failed" || state == "canceled";
    const Json job = service.post_action(id, ended ? "retry" : command.action);
    if (command.json)
      print_json_line(job);
    else
      std::printf("%s\n", state_line(job).c_str());
  }
}

}  // namespace

void add_job_action_commands(CommandLine& line) {
  const auto add = [&](const char* action, const char* description) {
    add_service_command<JobActionCommand>(line, action, description).action = action;
  };
  add("cancel", "cancel jobs of a server and discard their results");
  add("suspend", "suspend jobs of a server, to be resumed later");
  add("resume", "resume suspended jobs of a server, or retry failed and canceled ones");
}

}  // namespace voxdag::cli
