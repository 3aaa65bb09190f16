// cancel, suspend and resume: commands that ask one thing of some jobs.
#pragma once

#include <functional>
#include <string>

#include "cli/service/service_client.h"

namespace voxdag::cli {

// Asks for it and returns the JOB after it.
using JobAction = std::function<Json(Server& server, const std::string& id)>;

void add_job_action_command(CLI::App& app, CommandContext& context, const std::string& name,
                            const std::string& description, const JobAction& action);

// POSTs the verb ("cancel", ...) of the API.
Json post_verb(Server& server, const std::string& id, const std::string& verb);

}  // namespace voxdag::cli
