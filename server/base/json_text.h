// JSON as text. Only for source files that include nlohmann/json.hpp anyway.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace voxdag::server {

// The value on one line. Bytes that are not UTF-8 are replaced, since texts come from scenes.
template <class Json>
std::string json_text(const Json& value) {
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace voxdag::server
