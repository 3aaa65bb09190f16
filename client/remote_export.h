// Lets a server export the result of a job.
#pragma once

#include <string>
#include <vector>

#include "client/result_download.h"
#include "client/service_client.h"
#include "core/base/progress.h"

namespace voxdag::client {

// Requests an export of the job's result, waits until it has ended, and returns it as the JSON
// object EXPORT of docs/api.md. `request` is the body of the request. If the job already has this
// export, returns it. Throws the error of an export that failed, and Error{kCanceled} if cancel()
// is canceled; the export itself continues.
Json make_export(ServiceClient& service, const std::string& job, const Json& request,
                 Progress& progress);

// Returns the exports of a job as a list of EXPORT, oldest first.
Json exports_of(ServiceClient& service, const std::string& job);

// Deletes an export and its files. Returns false if the server still has to stop the export's
// process and deletes the export later. Throws Error{kInvalidInput} unless `id` is 16 hex digits.
bool delete_export(ServiceClient& service, const std::string& job, const std::string& id);

// Returns the files of an EXPORT.
std::vector<RemoteFile> files_of_export(const Json& exported);

}  // namespace voxdag::client
