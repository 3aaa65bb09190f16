// JSON schemas of the bodies of requests and answers (docs/api.md), by name.
#pragma once

#include <nlohmann/json.hpp>

namespace voxdag::server {

using Json = nlohmann::ordered_json;

// An object of schemas: "Job", "Scene", ...
const Json& schemas();

}  // namespace voxdag::server
