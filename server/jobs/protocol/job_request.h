// What a client asks to be built: the body of POST /jobs.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "scheduler/spec/build_spec.h"

namespace voxdag::server {

struct JobRequest {
  std::string name;
  int priority = 0;
  std::vector<std::string> scenes;  // names of uploads, or absolute paths
  BuildSpec spec;                   // without scenes, output and work folder
  std::string text;                 // JSON of scene, resolution and options, as submitted
};

// Throws RequestError{kInvalid} naming the member that is unknown, missing or has a wrong value.
JobRequest parse_job_request(std::string_view body);
// A priority as a JSON number. Throws RequestError{kInvalid}.
int parse_priority(std::string_view number);

}  // namespace voxdag::server
