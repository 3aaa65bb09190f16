#include "scene/gltf/json/json_element.h"

#include <cmath>

#include "core/fields/json_text.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

std::string describe(const nlohmann::json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return "an array";
  if (value.is_string()) return "a string";
  return exact_json_text(value);
}

}  // namespace

std::string JsonElement::path() const {
  std::string path = parent_ ? parent_->path() : "";
  if (!key_.empty()) path.append(path.empty() ? "" : ".").append(printable(key_));
  if (index_ != kNoIndex) path += '[' + std::to_string(index_) + ']';
  return path;
}

std::optional<JsonElement> JsonElement::find(const char* key) const {
  expect_object();
  const auto found = value_.find(key);
  if (found == value_.end()) return {};
  return JsonElement(*found, key, kNoIndex, this);
}

JsonElement JsonElement::at(const char* key) const {
  if (const auto member = find(key)) return *member;
  throw Violation{path() + "." + key + " is missing, but glTF requires it"};
}

void JsonElement::expect_object() const {
  if (!value_.is_object()) violate("an object");
}

std::optional<uint64_t> JsonElement::whole_number() const {
  constexpr double kExact = 0x1p53;
  if (value_.is_number_unsigned()) return value_.get<uint64_t>();
  if (!value_.is_number()) return {};
  const double number = value_.get<double>();  // also for "-0", which the parser reads as signed
  if (!(number >= 0 && number <= kExact) || number != std::floor(number)) return {};
  return static_cast<uint64_t>(number);
}

int JsonElement::as_index() const {
  const auto number = whole_number();
  if (!number || *number > INT32_MAX) violate("a whole number from 0 to 2147483647");
  return static_cast<int>(*number);
}

uint64_t JsonElement::as_size() const {
  const auto number = whole_number();
  if (!number || *number > INT64_MAX) violate("a whole number from 0 to 9223372036854775807");
  return *number;
}

double JsonElement::as_number() const {
  if (!value_.is_number()) violate("a number");
  return value_.get<double>();
}

bool JsonElement::as_boolean() const {
  if (!value_.is_boolean()) violate("true or false");
  return value_.get<bool>();
}

const std::string& JsonElement::as_string() const {
  if (!value_.is_string()) violate("a string");
  return value_.get_ref<const std::string&>();
}

void JsonElement::violate(const char* expected) const {
  throw Violation{path() + " is " + describe(value_) + ", expected " + expected};
}

}  // namespace voxdag::gltf
