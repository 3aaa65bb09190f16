// Converts JSON to text. Include this header only in source files that use nlohmann/json.hpp
// themselves.
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
