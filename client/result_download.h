// Downloads the result of a job, resumable and verified by its SHA-256.
#pragma once

#include <cstdint>
#include <string>

#include "client/service_client.h"
#include "core/base/progress.h"
#include "core/io/file_system.h"

namespace voxdag::client {

struct DownloadResult {
  uint64_t bytes = 0;
  uint64_t resumed_bytes = 0;  // already present from an earlier attempt
  std::string sha256;
};

// Downloads the .vdag file of a succeeded JOB to `output`. Until it is complete and verified it is
// named `output`.<first digits of the SHA-256>.partial, where a later call resumes. Retries as
// RetryPolicy does; every attempt that makes progress starts it over. Throws Error{kNotFound} for a
// job that has not succeeded, Error{kCorrupt} if the bytes do not match the SHA-256.
DownloadResult download_result(ServiceClient& service, FileSystem& files, const Json& job,
                               const std::string& output, Progress& progress);

}  // namespace voxdag::client
