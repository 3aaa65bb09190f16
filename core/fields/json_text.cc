#include "core/fields/json_text.h"

#include <nlohmann/json.hpp>

namespace voxdag {

template <class Json>
std::string json_text(const Json& value, int indent) {
  return value.dump(indent, ' ', false, Json::error_handler_t::replace);
}

template <class Json>
std::string ascii_json_text(const Json& value) {
  return value.dump(-1, ' ', true, Json::error_handler_t::replace);
}

template <class Json>
std::string exact_json_text(const Json& value, int indent) {
  return value.dump(indent);
}

template <class Json>
Json parse_json(std::string_view text) {
  return Json::parse(text);
}

template <class Json>
Json try_parse_json(std::string_view text) {
  return Json::parse(text, nullptr, false);
}

template std::string json_text(const nlohmann::json&, int);
template std::string json_text(const nlohmann::ordered_json&, int);
template std::string ascii_json_text(const nlohmann::json&);
template std::string ascii_json_text(const nlohmann::ordered_json&);
template std::string exact_json_text(const nlohmann::json&, int);
template std::string exact_json_text(const nlohmann::ordered_json&, int);
template nlohmann::json parse_json(std::string_view);
template nlohmann::ordered_json parse_json(std::string_view);
template nlohmann::json try_parse_json(std::string_view);
template nlohmann::ordered_json try_parse_json(std::string_view);

}  // namespace voxdag
