#include "server/base/printable_json.h"

#include <nlohmann/json.hpp>

#include "core/base/text/printable.h"
#include "core/fields/json_text.h"

namespace voxdag::server {

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

template void make_printable(nlohmann::json&);
template void make_printable(nlohmann::ordered_json&);

std::string printable_json_text(const std::string& json) {
  if (json.find('\\') == std::string::npos && is_printable(json)) return json;
  auto value = try_parse_json<nlohmann::ordered_json>(json);
  make_printable(value);
  return json_text(value);
}

}  // namespace voxdag::server
