// The commands cancel, suspend and resume: one action on one or more jobs.
#include <cstdio>
#include <memory>
#include <vector>

#include "cli/service/job_text.h"
#include "cli/service/service_options.h"

namespace voxdag::cli {
namespace {

struct JobActionCommand {
  ServiceOptions service;
  std::vector<std::string> ids;
  bool json = false;
};

// `action` is a name of the API; "resume" retries a failed or canceled job.
Json act(ServiceClient& service, const std::string& id, const std::string& action) {
  if (action != "resume") return service.post_action(id, action);
  const std::string state = service.job(id).at("state");
  return service.post_action(id, state == "failed" || state == "canceled" ? "retry" : "resume");
}

void add_job_action_command(CLI::App& app, CommandContext& context, const std::string& action,
                            const std::string& description) {
  CLI::App* command = app.add_subcommand(action, description);
  const auto state = std::make_shared<JobActionCommand>();
  command->add_option("id", state->ids, "job id; several may be given")->required();
  state->service.declare(*command);
  command->add_flag("--json", state->json, "each job as one JSON object on standard output");
  command->callback([state, action, &context] {
    state->service.with_service(context, [&](ServiceClient& service) {
      for (const std::string& id : state->ids) {
        const Json job = act(service, id, action);
        std::printf("%s\n", state->json ? job.dump().c_str() : state_line(job).c_str());
      }
    });
  });
}

}  // namespace

void add_cancel_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(app, context, "cancel",
                         "cancel jobs of a server and discard what they have built");
}

void add_suspend_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(app, context, "suspend", "suspend jobs of a server, to be resumed later");
}

void add_resume_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(app, context, "resume",
                         "resume suspended jobs of a server, or retry failed and canceled ones");
}

}  // namespace voxdag::cli
