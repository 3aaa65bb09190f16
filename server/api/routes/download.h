// Downloads of large files, with ranges: results of jobs and exports.
#pragma once

#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/io/file_system.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routing/route.h"

namespace voxdag::server {

// Returns the job with the id of the call. Throws Problem (404) unless it has succeeded.
Job finished_job(Context& context, Call& call);

// Advice of open_kept() for files that only a new job can make.
inline constexpr const char* kNewJobAdvice = "submit a new job of the scene";

// Returns open(), which opens a file of a job that has succeeded. Throws Problem (404) if the file
// was removed from the service's disk. The problem names the job and `file`, a description of the
// file, and gives `advice` on how to get such a file.
template <class Open>
auto open_kept(const std::string& job, const std::string& file, const char* advice,
               const Open& open) {
  try {
    return open();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
    throw not_found(file + " of the job " + job +
                    " was removed from the disk of the service: expected it to remain until it is "
                    "deleted by a request; " +
                    advice);
  }
}
// Returns the beginning of the file name of a download, NAME-RESOLUTION. NAME is the name of the
// job, or of its first scene if the job has no name, reduced to characters that are safe in headers
// and shells.
std::string download_stem(const Job& job, uint64_t resolution);

// Answers with a file, or with the ranges of it that the request selects. `name` is the file name
// that the client sees. Throws Problem: 416 if no range is within the file, 503 if too many
// downloads are in progress.
Response download(Context& context, Call& call, std::shared_ptr<ReadableFile> file,
                  const std::string& sha256, const std::string& name);
// Returns the GET route with the headers, answers and problems of a download.
Route download_route(Route route);

}  // namespace voxdag::server
