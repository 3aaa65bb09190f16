#include "scene/gltf/json/element_text.h"

#include <cmath>
#include <utility>

#include "core/fields/json_text.h"

namespace voxdag::gltf {

namespace {

using Json = nlohmann::json;

// Writes 36.0 as 36, because tinygltf does not accept a decimal point where it expects an integer.
std::string text_of(const Json& value) {
  constexpr double kExact = 0x1p53;
  const double number = value.is_number_float() ? value.get<double>() : 0.5;
  const bool is_whole = number == std::floor(number) && std::abs(number) <= kExact;
  return is_whole && !std::signbit(number) ? std::to_string(static_cast<int64_t>(number))
                                           : exact_json_text(value);
}

}  // namespace

void ElementTextWriter::add_scalar(std::string_view key, const Json& value) {
  begin_value(key);
  if (value.is_string()) written_.string_bytes += value.get_ref<const std::string&>().size();
  written_.text += text_of(value);
}

void ElementTextWriter::start(std::string_view key, const Json& value) {
  begin_value(key);
  const bool is_member = !open_.empty() && open_.back().is_object;
  const bool is_inside = !open_.empty() && open_.back().is_extensions;
  open_.push_back({value.is_object(), is_inside || (is_member && key == "extensions"), true});
  written_.text += value.is_object() ? '{' : '[';
}

void ElementTextWriter::end() {
  written_.text += open_.back().is_object ? '}' : ']';
  open_.pop_back();
}

ElementText ElementTextWriter::take() {
  open_.clear();
  return std::exchange(written_, {});
}

// Called before a value is written. Counts the value, and writes the comma and the key that precede
// it.
void ElementTextWriter::begin_value(std::string_view key) {
  ++written_.values;
  if (open_.empty()) return;
  Container& around = open_.back();
  if (around.is_extensions) ++written_.values_in_extensions;
  if (!std::exchange(around.is_empty, false)) written_.text += ',';
  if (!around.is_object) return;
  ++written_.members;
  written_.string_bytes += key.size();
  written_.text.append(exact_json_text(Json(key))).append(":");
}

}  // namespace voxdag::gltf
