// Downloads the result of a job or a file of an export, resumable and verified by its SHA-256.
#pragma once

#include <cstdint>
#include <string>

#include "client/service_client.h"
#include "core/base/progress.h"
#include "core/io/file_system.h"

namespace voxdag::client {

struct DownloadResult {
  uint64_t bytes = 0;
  uint64_t resumed_bytes = 0;  // already downloaded by an earlier attempt
  std::string sha256;
};

// A file that a server offers at the address `path`.
struct RemoteFile {
  std::string path;
  uint64_t bytes = 0;
  std::string sha256;
};

// Downloads a file to `output`. Until its SHA-256 is verified, the file has the name
// `output`.D.partial, where D is the first 12 digits of the SHA-256. If this file exists, the
// download continues at its end. Failed attempts are repeated as RetryPolicy (retry_policy.h)
// allows; an attempt that makes progress restarts the policy. Throws Error{kCorrupt} if the bytes
// do not match the SHA-256, and Error{kIo} when no further retry is allowed.
DownloadResult download_file(ServiceClient& service, FileSystem& files, const RemoteFile& file,
                             const std::string& output, Progress& progress);

// Downloads the .vdag file of a job. `job` is the JSON object JOB of docs/api.md. Throws like
// download_file(), and Error{kNotFound} for a job that has not succeeded.
DownloadResult download_result(ServiceClient& service, FileSystem& files, const Json& job,
                               const std::string& output, Progress& progress);

}  // namespace voxdag::client
