// Jobs of the service in words.
#pragma once

#include <string>

#include "cli/service/service_client.h"

namespace voxdag::cli {

// Text from the network without control characters, which a terminal would obey.
std::string printable(std::string text);
bool has_ended(const Json& job);
// "job 6b1f0c7a93d2e845: queued, number 2 in the queue"
std::string state_line(const Json& job);
// What it is called, or else its scenes.
std::string job_title(const Json& job);
// The state, and how far it is: "build 32 %, 31.4 s left", "118 MiB".
std::string progress_text(const Json& job);
// A succeeded job's result, a few lines.
void print_result(const Json& job);

}  // namespace voxdag::cli
