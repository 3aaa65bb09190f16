#include "cli/service/job_action.h"

namespace voxdag::cli {

void add_suspend_command(CLI::App& app, CommandContext& context) {
  add_job_action_command(
      app, context, "suspend", "suspend jobs of a server; what they built stays",
      [](Server& server, const std::string& id) { return post_verb(server, id, "suspend"); });
}

}  // namespace voxdag::cli
