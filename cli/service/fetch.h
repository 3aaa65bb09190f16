// Fetches a job's result.
#pragma once

#include <string>

#include "cli/service/service_client.h"

namespace voxdag::cli {

struct Fetched {
  uint64_t bytes = 0;
  uint64_t resumed_at = 0;  // how much of it an earlier attempt had left
  std::string sha256;
};

// Downloads the .vdag file of a job that succeeded. Until it is whole and its SHA-256 is right it
// lies beside `output`, as OUT.<first digits of the SHA-256>.partial, and the same command goes on
// from what is there. Progress goes to standard error. Throws Error{kCorrupt} if the bytes are not
// those that the job made.
Fetched fetch_result(Server& server, const Json& job, const std::string& output);

}  // namespace voxdag::cli
