// Sends a scene to the server.
#pragma once

#include <string>

#include "cli/service/service_client.h"

namespace voxdag::cli {

// Uploads a local file and returns the name that it has there: its own, with twelve digits of its
// SHA-256 before the ending, so that another file of that name is never replaced and the same file
// is sent once. What arrived before a connection broke, or before the command was stopped, is not
// sent again. Progress goes to standard error.
std::string upload_scene(Server& server, const std::string& path);

}  // namespace voxdag::cli
