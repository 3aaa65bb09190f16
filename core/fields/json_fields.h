// Converts structs that have a `fields` function (field.h) to and from JSON. There are two kinds of
// JSON:
//
//   - The JSON of a record has all members, except optional members without a value and empty
//     members with omit_empty(). A decoder ignores unknown members.
//   - The JSON of options has only the members that differ from their defaults. A decoder refuses
//     unknown members.
#pragma once

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "core/fields/field.h"
#include "core/fields/json_text.h"

namespace voxdag {

using FieldJson = nlohmann::ordered_json;

namespace json_fields {

[[noreturn]] void refuse(const std::string& name, const std::string& expected);
// Like the other refuse(), but the message also shows the refused value, shortened.
[[noreturn]] void refuse(const std::string& name, const std::string& expected,
                         const FieldJson& found);
// Refuses a member that an object has twice (repeated_member() in json_text.h).
[[noreturn]] void refuse_repeated(const std::string& name);
// Reads a whole number, which may be written as 64.0. Calls `take_unsigned` or `take_signed`,
// depending on the type of the JSON number, and returns the result of this call. Returns false if
// `json` is not a whole number.
bool whole_number(const FieldJson& json, const std::function<bool(uint64_t)>& take_unsigned,
                  const std::function<bool(int64_t)>& take_signed);

template <class T>
FieldJson encode(T value);

template <class T>
FieldJson encode_value(T& value) {
  if constexpr (IsOptional<T>::value) {
    return value ? encode_value(*value) : FieldJson();
  } else if constexpr (Described<T>) {
    return encode(value);
  } else if constexpr (NamedEnum<T>) {
    return name_of(value);
  } else if constexpr (NameSet<T>) {
    return NameSetTraits<T>::names(value);
  } else if constexpr (IsVector<T>::value) {
    FieldJson array = FieldJson::array();
    for (auto& item : value) array.push_back(encode_value(item));
    return array;
  } else {
    return value;
  }
}

// A visitor that adds the members of a struct to a JSON object.
class Encoder {
 public:
  explicit Encoder(FieldJson& object) : object_(object) {}

  template <class T>
  void operator()(const Field& field, T& value) {
    if constexpr (IsOptional<T>::value)
      if (!value) return;
    if constexpr (requires { value.empty(); })
      if (field.is_left_if_empty && value.empty()) return;
    object_[field.name] = encode_value(value);
  }
  void object(const char* name, const auto& visit_members) {
    FieldJson members = FieldJson::object();
    Encoder encoder(members);
    visit_members(encoder);
    object_[name] = std::move(members);
  }
  void derived(const char* name, const auto& value) { object_[name] = value; }

 private:
  FieldJson& object_;
};

template <class T>
FieldJson encode(T value) {
  FieldJson object = FieldJson::object();
  Encoder encoder(object);
  fields(encoder, value);
  return object;
}

// Returns the members of `options` that differ from the members of `defaults`, also within nested
// objects.
FieldJson difference(const FieldJson& options, const FieldJson& defaults);

inline constexpr size_t kMaxNames = 64;  // maximum number of names in a set, for options

// kAll: the JSON of a record. All members must be present, except optional members and members with
// omit_empty(). kGiven: the JSON of options. Only members with required() must be present.
enum class Members { kAll, kGiven };

template <class T>
void decode(const FieldJson& json, const std::string& name, Members members, T& value);

template <class T>
void decode_integer(const Field& field, const FieldJson& json, T& value) {
  const auto take = [&](auto number) {
    if (!std::in_range<T>(number)) return false;
    value = static_cast<T>(number);
    return true;
  };
  if (field.is_bytes && json.is_string()) {
    const auto bytes = size_of_text(json.get<std::string>());
    if (bytes && take(*bytes)) return;
  } else if (whole_number(json, take, take)) {
    return;
  }
  refuse(field.name, expectation<T>(field), json);
}

template <class T>
void decode_value(const Field& field, const FieldJson& json, Members members, T& value) {
  const auto expect = [&](bool is_valid) {
    if (!is_valid) refuse(field.name, expectation<T>(field), json);
  };
  if constexpr (IsOptional<T>::value) {
    decode_value(field, json, members, value.emplace());
  } else if constexpr (std::is_same_v<T, bool>) {
    expect(json.is_boolean());
    value = json.get<bool>();
  } else if constexpr (std::is_integral_v<T>) {
    decode_integer(field, json, value);
  } else if constexpr (std::is_floating_point_v<T>) {
    expect(json.is_number());
    value = json.get<T>();
  } else if constexpr (std::is_same_v<T, std::string>) {
    expect(json.is_string());
    value = json.get<std::string>();
  } else if constexpr (NamedEnum<T>) {
    const auto found = json.is_string() ? enum_of<T>(json.get<std::string>()) : std::nullopt;
    expect(found && (members == Members::kAll || *name_of(*found)));
    value = *found;
  } else if constexpr (IsNumbers<T>::value) {
    expect(json.is_array() && json.size() == value.size());
    for (size_t i = 0; i < value.size(); ++i)
      decode_value(Field(field.name), json[i], members, value[i]);
  } else if constexpr (NameSet<T>) {
    std::vector<std::string> names;
    const size_t max_items = members == Members::kGiven ? kMaxNames : 0;
    decode_value(Field(field.name).items(max_items), json, members, names);
    for (const std::string& name : names)
      if (!NameSetTraits<T>::add(value, name)) refuse(field.name, expectation<T>(field), name);
  } else if constexpr (IsVector<T>::value) {
    // In options, a list of limited length may be written as a single item. The item is not copied
    // into an array first, because copying recurses, and could overflow the stack if the JSON of a
    // request is deeply nested.
    const bool is_item = members == Members::kGiven && field.max_items > 0 && !json.is_array();
    expect(is_item || json.is_array());
    value.clear();
    if (is_item)
      decode_value(field, json, members, value.emplace_back());
    else
      for (const FieldJson& item : json) decode_value(field, item, members, value.emplace_back());
  } else if constexpr (Described<T>) {
    decode(json, field.name, members, value);
  } else {
    expect(json.is_object());
    value = json.get<T>();
  }
  expect(fits(field, value));
}

// A visitor that finds members of nested objects by their name.
class NestedMemberFinder {
 public:
  // `name` must outlive this object.
  explicit NestedMemberFinder(const std::string& name) : name_(name) {}

  template <class T>
  void operator()(const Field& field, T& value) {
    if constexpr (Described<T>)
      enter(field.name, [&] { fields(*this, value); });
    else if (field.name == name_)
      path_ = prefix_ + name_;
  }
  void object(const char* name, const auto& visit_members) {
    enter(name, [&] { visit_members(*this); });
  }
  void derived(const char*, const auto&) {}

  // Returns the path of the member, such as "options.color", or "" if there is none.
  const std::string& path() const { return path_; }

 private:
  void enter(const std::string& object, const auto& visit) {
    const std::string outer = prefix_;
    prefix_ += object + ".";
    visit();
    prefix_ = outer;
  }

  const std::string& name_;
  std::string prefix_, path_;
};

// A visitor that sets the members of a struct from a JSON object. Throws FieldError.
class Decoder {
 public:
  Decoder(const FieldJson& object, const std::string& name, Members members)
      : object_(object), members_(members) {
    if (!object.is_object()) refuse(name, "an object", object);
  }

  template <class T>
  void operator()(const Field& field, T& value) {
    known_.emplace_back(field.name);
    const auto found = object_.find(field.name);
    if (found != object_.end()) return decode_value(field, *found, members_, value);
    const bool may_lack = members_ == Members::kGiven
                              ? !field.is_required
                              : IsOptional<T>::value || field.is_left_if_empty;
    if (!may_lack) refuse(field.name, expectation<T>(field) + ", but the member is missing");
  }
  void object(const char* name, const auto& visit_members) {
    known_.emplace_back(name);
    static const FieldJson kNothing;
    const auto found = object_.find(name);
    if (found == object_.end() && members_ == Members::kGiven) return;
    Decoder decoder(found == object_.end() ? kNothing : *found, name, members_);
    visit_members(decoder);
    if (members_ == Members::kGiven) decoder.refuse_unknown_members(name);
  }
  void derived(const char* name, const auto&) { known_.emplace_back(name); }

  // Throws FieldError if the object has a member that the struct does not have. `where` is the name
  // of the object in the message.
  // `suggest(name)` returns the end of the message: a phrase that names a similar member, or "".
  void refuse_unknown_members(
      const std::string& where,
      const std::function<std::string(const std::string& name)>& suggest = nullptr) const;

 private:
  const FieldJson& object_;
  const Members members_;
  std::vector<std::string> known_;
};

template <class T>
void decode(const FieldJson& json, const std::string& name, Members members, T& value) {
  Decoder decoder(json, name, members);
  fields(decoder, value);
  if (members == Members::kGiven)
    decoder.refuse_unknown_members(name, [](const std::string& unknown) {
      NestedMemberFinder finder(unknown);
      T defaults;
      fields(finder, defaults);
      return finder.path().empty() ? "" : "; did you mean '" + finder.path() + "'?";
    });
}

}  // namespace json_fields

template <class T>
FieldJson record_json(const T& record) {
  return json_fields::encode(record);
}

// Returns the record that the JSON describes. If the JSON is not valid for a T, throws a FieldError
// that names the member.
template <class T>
T record_from_json(const FieldJson& json) {
  T record;
  json_fields::decode(json, "the record", json_fields::Members::kAll, record);
  return record;
}

// Returns the record that the JSON text describes. Throws Error{kCorrupt} if the text is not JSON
// or not valid for a T. The message begins with `what`, which names the text's origin.
template <class T>
T record_from_text(std::string_view text, const std::string& what) {
  try {
    return record_from_json<T>(parse_json<FieldJson>(text));
  } catch (const FieldError& error) {
    throw Error(ErrorCode::kCorrupt, what + ": " + error.message());
  } catch (const nlohmann::json::exception& error) {
    throw Error(ErrorCode::kCorrupt, what + " is not JSON (" + error.what() + ")");
  }
}

template <class T>
FieldJson options_json(const T& options) {
  return json_fields::difference(json_fields::encode(options), json_fields::encode(T{}));
}

// Sets the options that `json` contains and leaves the others unchanged. Throws a FieldError that
// names the member. `name` is the name of `json` in messages.
template <class T>
void set_options(const FieldJson& json, const std::string& name, T& options) {
  json_fields::decode(json, name, json_fields::Members::kGiven, options);
}

}  // namespace voxdag
