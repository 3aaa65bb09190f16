// The words of messages of jobs and exports. Clients of the API receive these messages. So most
// options are spelled as members of a request. Some options belong to the service's settings, and
// some have no counterpart in the API (OptionSpeller, core/base/options/option_text.h).
#pragma once

#include <string>
#include <string_view>

#include "core/base/options/option_text.h"

namespace voxdag::server {

std::string spell_job_option(std::string_view name, std::string_view value);
std::string spell_export_option(std::string_view name, std::string_view value);
// "a job with \"solid\": \"winding\"", "a request with dry_run=true". Returns "" for all commands
// other than build and plan.
std::string spell_request(std::string_view command, std::string_view option,
                          std::string_view value);

inline constexpr Audience kJobUsers{&spell_job_option, &spell_request, "retry the job"};
inline constexpr Audience kExportUsers{&spell_export_option, &spell_request,
                                       "request the export again"};

}  // namespace voxdag::server
