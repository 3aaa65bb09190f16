// The body and the signature of a webhook. Pure functions.
#pragma once

#include <string>

#include "server/queue/ended_jobs.h"
#include "server/queue/job.h"

namespace voxdag::server {

// Returns the URL that the job's request names; "" if it names none.
std::string webhook_url_of(const Job& job);
// Returns the body of the delivery `id`, which reports this end of the job.
std::string webhook_body(const std::string& id, const Job& job, const JobEvent& end);
// Returns the value of the header X-Voxdag-Signature: "sha256=" and the HMAC-SHA256 of the body in
// hex.
std::string webhook_signature(const std::string& secret, const std::string& body);

}  // namespace voxdag::server
