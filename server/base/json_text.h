// JSON as text. Only for source files that include nlohmann/json.hpp anyway.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace voxdag::server {

// Returns the value on one line. Replaces bytes that are not UTF-8, because texts may come from
// scenes.
template <class Json>
std::string json_text(const Json& value) {
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace voxdag::server
