#include "cli/service/job_action.h"

namespace voxdag::cli {
namespace {

// A suspended job goes on; one that failed or was canceled is tried again.
Json resume(Server& server, const std::string& id) {
  const std::string state = server.job(id).at("state");
  return post_verb(server, id, state == "failed" || state == "canceled" ? "retry" : "resume");
}

}  // namespace

void add_resume_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(app, context, "resume",
                         "go on with suspended jobs of a server, or try failed ones again", resume);
}

}  // namespace voxdag::cli
