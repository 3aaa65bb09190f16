#include "cli/service/job_action.h"

namespace voxdag::cli {

void add_cancel_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(
      app, context, "cancel", "cancel jobs of a server; what they built goes",
      [](Server& server, const std::string& id) { return post_verb(server, id, "cancel"); });
}

}  // namespace voxdag::cli
