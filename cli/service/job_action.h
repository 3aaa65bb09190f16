// cancel, suspend and resume: commands that ask one thing of some jobs.
#pragma once

#include <functional>
#include <string>

#include "cli/service/service_client.h"

namespace voxdag::cli {

// Asks for it and returns the JOB after it.
using Deed = std::function<Json(Server& server, const std::string& id)>;

void add_job_deed_command(CLI::App& app, CommandContext& context, const std::string& name,
                          const std::string& description, const Deed& deed);

// POSTs the verb ("cancel", ...) of the API.
Json post_verb(Server& server, const std::string& id, const std::string& verb);

}  // namespace voxdag::cli
