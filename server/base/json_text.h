// Converts JSON to text. Include this header only in source files that use nlohmann/json.hpp
// themselves.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/base/text/printable.h"

namespace voxdag::server {

// Returns the value on one line. Replaces invalid UTF-8, which strings from scenes can contain.
template <class Json>
std::string json_text(const Json& value) {
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// Makes all texts in the JSON printable, including the names of members. For answers that contain
// texts of scenes or of other programs.
template <class Json>
void make_printable(Json& value) {
  if (value.is_string()) value = printable_line(value.template get_ref<const std::string&>());
  if (value.is_array())
    for (Json& item : value) make_printable(item);
  if (!value.is_object()) return;
  Json members = Json::object();
  for (auto& [name, member] : value.items()) {
    make_printable(member);
    members[printable_line(name)] = std::move(member);
  }
  value = std::move(members);
}

// Returns the JSON with printable texts. The text is parsed only if it may need a change.
inline std::string printable_json_text(const std::string& json) {
  if (json.find('\\') == std::string::npos && is_printable(json)) return json;
  auto value = nlohmann::ordered_json::parse(json, nullptr, false);
  make_printable(value);
  return json_text(value);
}

}  // namespace voxdag::server
