#include "core/fields/json_text.h"

#include <nlohmann/json.hpp>
#include <set>
#include <vector>

namespace voxdag {

template <class Json>
std::string json_text(const Json& value, int indent) {
  return value.dump(indent, ' ', false, Json::error_handler_t::replace);
}

std::string as_utf8(const std::string& text) {
  return nlohmann::json::parse(json_text(nlohmann::json(text))).get<std::string>();
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

std::optional<std::string> repeated_member(std::string_view text) {
  using Json = nlohmann::json;
  std::vector<std::set<std::string>> open;  // names of the objects around the parser's position
  std::optional<std::string> repeated;
  const auto see = [&](int, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::object_start) open.emplace_back();
    if (event == Json::parse_event_t::object_end) open.pop_back();
    if (event == Json::parse_event_t::key &&
        !open.back().insert(parsed.get_ref<const std::string&>()).second && !repeated)
      repeated = parsed.get<std::string>();
    return true;
  };
  const bool is_json = !Json::parse(text, see, false).is_discarded();
  return is_json ? repeated : std::nullopt;
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
