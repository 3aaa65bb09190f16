// Spells options in the messages of jobs and exports. Clients of the API receive these messages. So
// most options are spelled as members of a request. Some options belong to the service's settings,
// and some have no counterpart in the API (OptionSpeller, core/base/options/option_text.h).
#pragma once

#include <string>
#include <string_view>

namespace voxdag::server {

std::string spell_job_option(std::string_view name, std::string_view value);
std::string spell_export_option(std::string_view name, std::string_view value);

}  // namespace voxdag::server
