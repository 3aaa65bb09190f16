// The commands cancel, suspend and resume: one action on one or more jobs.
#include <cstdio>
#include <functional>
#include <memory>
#include <vector>

#include "cli/service/job_text.h"
#include "cli/service/service_options.h"

namespace voxdag::cli {
namespace {

// Performs the action and returns the JOB after it.
using JobAction = std::function<Json(ServiceClient& service, const std::string& id)>;

struct JobActionCommand {
  ServiceOptions service;
  std::vector<std::string> ids;
  bool json = false;
};

void add_job_action_command(CLI::App& app, CommandContext& context, const std::string& name,
                            const std::string& description, const JobAction& action) {
  CLI::App* command = app.add_subcommand(name, description);
  const auto state = std::make_shared<JobActionCommand>();
  command->add_option("id", state->ids, "job id; several may be given")->required();
  state->service.declare(*command);
  command->add_flag("--json", state->json, "each job as one JSON object on standard output");
  command->callback([state, action, &context] {
    state->service.with_service(context, [&](ServiceClient& service) {
      for (const std::string& id : state->ids) {
        const Json job = action(service, id);
        std::printf("%s\n", state->json ? job.dump().c_str() : state_line(job).c_str());
      }
    });
  });
}

// A failed or canceled job is retried, any other one resumed.
Json resume(ServiceClient& service, const std::string& id) {
  const std::string state = service.job(id).at("state");
  return service.post_action(id, state == "failed" || state == "canceled" ? "retry" : "resume");
}

}  // namespace

void add_cancel_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(app, context, "cancel",
                         "cancel jobs of a server and discard what they have built",
                         [](ServiceClient& service, const std::string& id) {
                           return service.post_action(id, "cancel");
                         });
}

void add_suspend_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(app, context, "suspend", "suspend jobs of a server, to be resumed later",
                         [](ServiceClient& service, const std::string& id) {
                           return service.post_action(id, "suspend");
                         });
}

void add_resume_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(app, context, "resume",
                         "resume suspended jobs of a server, or retry failed and canceled ones",
                         resume);
}

}  // namespace voxdag::cli
