#include "core/fields/json_fields.h"

#include <algorithm>
#include <cmath>

#include "core/fields/json_text.h"

namespace voxdag::json_fields {

namespace {

constexpr size_t kMaxShownBytes = 64;  // bytes of a text that messages show
constexpr size_t kMaxShownItems = 8;   // items of an array that messages show

// Returns a value as text for messages: printable ASCII of limited length. Does not show the
// contents of an object or of a nested array, because formatting deeply nested JSON recurses and
// could overflow the stack.
std::string shown(const FieldJson& json) {
  if (json.is_object()) return "an object";
  if (json.is_array() &&
      (json.size() > kMaxShownItems || std::ranges::any_of(json, [](const FieldJson& item) {
         return item.is_structured() || item.is_string();
       })))
    return "an array of " + std::to_string(json.size()) + " items";
  if (!json.is_string()) return ascii_json_text(json);
  const auto& text = json.get_ref<const std::string&>();
  if (text.size() <= kMaxShownBytes) return ascii_json_text(json);
  return ascii_json_text(FieldJson(text.substr(0, kMaxShownBytes))) + "...";
}

}  // namespace

void refuse(const std::string& name, const std::string& expected) {
  throw FieldError(name, expected);
}

void refuse(const std::string& name, const std::string& expected, const FieldJson& found) {
  throw FieldError(name, expected + ", not " + shown(found));
}

void refuse_repeated(const std::string& name) {
  refuse(name.substr(0, kMaxShownBytes), "the member once; an object has it twice");
}

bool whole_number(const FieldJson& json, const std::function<bool(uint64_t)>& take_unsigned,
                  const std::function<bool(int64_t)>& take_signed) {
  constexpr double kExact = 0x1p53;
  if (json.is_number_unsigned()) return take_unsigned(json.get<uint64_t>());
  if (json.is_number_integer()) return take_signed(json.get<int64_t>());
  if (!json.is_number_float()) return false;
  const double number = json.get<double>();
  if (std::abs(number) > kExact || number != std::floor(number)) return false;
  return take_signed(static_cast<int64_t>(number));
}

FieldJson difference(const FieldJson& options, const FieldJson& defaults) {
  FieldJson given = FieldJson::object();
  for (const auto& [name, value] : options.items()) {
    if (!defaults.contains(name)) {
      given[name] = value;
    } else if (value.is_object()) {
      if (FieldJson inner = difference(value, defaults.at(name)); !inner.empty())
        given[name] = std::move(inner);
    } else if (value != defaults.at(name)) {
      given[name] = value;
    }
  }
  return given;
}

void Decoder::refuse_unknown_members(
    const std::string& where,
    const std::function<std::string(const std::string& name)>& suggest) const {
  for (const auto& [name, value] : object_.items())
    if (std::ranges::find(known_, name) == known_.end())
      refuse(name.substr(0, 64), "a documented member of " + where + "; this member is unknown" +
                                     (suggest ? suggest(name) : ""));
}

}  // namespace voxdag::json_fields
