// Uploads a scene, resumable and verified by its SHA-256.
#pragma once

#include <string>

#include "client/service_client.h"
#include "core/base/progress.h"
#include "core/io/file_system.h"

namespace voxdag::client {

// Uploads the local scene file `path` and returns its name on the server. This name is the file's
// name with twelve digits of its SHA-256 before the ending, so that the upload replaces no other
// scene. The server decides which endings it accepts, and refuses other endings before any byte is
// sent. Does not send bytes again that the server already has, from this or an earlier call. Failed
// attempts are repeated as RetryPolicy (retry_policy.h) allows; an attempt that makes progress
// restarts the policy.
std::string upload_scene(ServiceClient& service, FileSystem& files, const std::string& path,
                         Progress& progress);

}  // namespace voxdag::client
