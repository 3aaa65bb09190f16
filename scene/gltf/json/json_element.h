// A value in the JSON of a scene file, with its position, for checked reading. A value of an
// unexpected type throws Violation with a message like "nodes[3].children[0] is -1, expected a
// whole number from 0 to 2147483647".
//
// An element refers to its value and to its parent element. Both must outlive it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "scene/gltf/json/file_range.h"

namespace voxdag::gltf {

// A violation of the rules of glTF 2.0 at a position in the JSON. The message begins with this
// position, for example "nodes[3].children[0]", and does not name the scene file.
struct Violation {
  std::string message;
};

class JsonElement {
 public:
  using Json = nlohmann::json;
  static constexpr int64_t kNoIndex = -1;

  // Makes element `index` of the root's array `section`, or the section itself if `index` is
  // kNoIndex. `uri` describes the member "uri" of this value if it is a string.
  JsonElement(const Json& value, std::string_view section, int64_t index, const RawString& uri)
      : value_(value), key_(section), index_(index), uri_(&uri) {}

  const Json& value() const { return value_; }
  // Returns the name of the section for a section of the root and for its elements, and the name of
  // the member for a member of an object. Returns "" for an element of another array.
  std::string_view key() const { return key_; }
  bool is_in_array() const { return index_ != kNoIndex; }
  const RawString& uri() const { return *uri_; }
  // Returns the position of the value for messages, such as "nodes[3].children[0]".
  std::string path() const;

  // Returns the member of an object; nullopt if it is absent.
  std::optional<JsonElement> find(const char* key) const;
  // Returns the member of an object. Throws Violation if it is absent.
  JsonElement at(const char* key) const;
  // Calls `visit` with each element of an array.
  template <class Visit>
  void for_each_element(const Visit& visit) const {
    if (!value_.is_array()) violate("an array");
    for (size_t i = 0; i < value_.size(); ++i)
      visit(JsonElement(value_[i], {}, static_cast<int64_t>(i), this));
  }
  // Calls `visit` with each member of an object.
  template <class Visit>
  void for_each_member(const Visit& visit) const {
    expect_object();
    for (auto m = value_.begin(); m != value_.end(); ++m)
      visit(JsonElement(m.value(), m.key(), kNoIndex, this));
  }

  void expect_object() const;
  // Returns the value of a whole number that is not negative, also if it is written like 36.0 or
  // 3.6e1; nullopt for any other value.
  std::optional<uint64_t> whole_number() const;
  int as_index() const;      // a whole number from 0 to 2^31 - 1
  uint64_t as_size() const;  // a whole number from 0 to 2^63 - 1
  double as_number() const;
  bool as_boolean() const;
  const std::string& as_string() const;

  // Throws Violation: "<path> is <value>, expected <expected>".
  [[noreturn]] void violate(const char* expected) const;

 private:
  JsonElement(const Json& value, std::string_view key, int64_t index, const JsonElement* parent)
      : value_(value), key_(key), index_(index), parent_(parent) {}

  const Json& value_;
  std::string_view key_;
  int64_t index_;
  const JsonElement* parent_ = nullptr;
  const RawString* uri_ = nullptr;
};

}  // namespace voxdag::gltf
