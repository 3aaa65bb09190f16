// JSON schemas of request and answer bodies (docs/api.md), by name.
#pragma once

#include <nlohmann/json.hpp>

namespace voxdag::server {

using Json = nlohmann::ordered_json;

// Returns an object with all schemas by name: "Job", "Scene", ...
const Json& schemas();

}  // namespace voxdag::server
