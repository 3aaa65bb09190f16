// Describes the members of a struct once, for all uses. A function `fields(visitor, value)` next to
// a struct passes its members to a visitor in order, with their names:
//
//   template <class Visitor>
//   void fields(Visitor& visit, Trip& trip) {
//     visit("city", trip.city);
//     visit(Field("days", "length of the trip").range(1, 30), trip.days);
//     visit.object("cost", [&](auto& cost) { cost("total", trip.total); });
//     visit.derived("daily_cost", trip.total / trip.days);
//   }
//
// There are visitors for JSON, JSON schemas, command-line options, Python keywords and checks.
// object() makes a nested JSON object from members of the same struct. derived() adds a computed
// value, which is written but not read.
//
// A visitor decides by the type of a member how to read and write the member. An enumeration needs
// a function enum_names(E), which returns the names of its values. A set of names needs a
// specialization of NameSetTraits.
//
// `fields` takes the struct by reference because some visitors set its members. Visitors that only
// read the struct are given a copy.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag {

// The first command that offers an option, in the order submit, plan, build. The commands after it
// also offer the option.
enum class Scope { kSubmit, kPlan, kBuild };

// Describes a member: its name, its documentation and its limits. All interfaces are made from this
// description. The name is also the JSON member, the Python keyword and, with dashes, the
// command-line option.
struct Field {
  const char* name;
  const char* help = "";
  const char* heading = "";       // heading of the option's group in --help
  const char* shorthand = "";     // another name of the option: "-r"
  const char* default_text = "";  // description of a default that is not a value: "half the RAM"
  const char* parts = "";         // names of an array's numbers: "X,Y,Z,EDGE"
  const char* excluded = "";      // another field that must not be given together with this one
  const char* needed = "";        // another field that must be given together with this one
  Scope scope = Scope::kSubmit;
  // Inclusive limits of an integer, of a size in bytes, or of the number of characters in a text.
  std::optional<int64_t> min, max;
  size_t max_items = 0;  // if not 0, a list must have 1 to max_items items
  bool is_power_of_two = false;
  bool is_above_zero = false;  // the number, or the last number of an array, must be above 0
  bool is_bytes = false;       // an integer that users write as 8GiB
  bool is_line = false;        // a text without control characters (one line)
  bool is_path = false;
  bool accepts_unset = false;  // 0 or an empty text on the command line means "not given"
  bool is_required = false;
  bool is_positional = false;     // positional on the command line
  bool is_left_if_empty = false;  // JSON omits the member if it is empty
  // geometry_json(), which identifies a build's options, always contains a field if `in_key` is
  // true, and never if it is false. If it is not set, geometry_json() contains the field only if
  // its value differs from the default.
  std::optional<bool> in_key;

  constexpr Field(const char* its_name, const char* its_help = "")
      : name(its_name), help(its_help) {}

  constexpr Field with(auto Field::*member, auto value) const {
    Field copy = *this;
    copy.*member = value;
    return copy;
  }
  constexpr Field group(const char* text) const { return with(&Field::heading, text); }
  constexpr Field range(int64_t low, int64_t high) const {
    return with(&Field::min, low).with(&Field::max, high);
  }
  constexpr Field at_least(int64_t low) const { return with(&Field::min, low); }
  constexpr Field power_of_two(int64_t low, int64_t high) const {
    return range(low, high).with(&Field::is_power_of_two, true);
  }
  constexpr Field above_zero() const { return with(&Field::is_above_zero, true); }
  constexpr Field bytes() const { return with(&Field::is_bytes, true); }
  constexpr Field line(int64_t characters) const {
    return range(1, characters).with(&Field::is_line, true);
  }
  constexpr Field items(size_t limit) const { return with(&Field::max_items, limit); }
  constexpr Field path() const { return with(&Field::is_path, true); }
  constexpr Field required() const { return with(&Field::is_required, true); }
  constexpr Field positional() const { return with(&Field::is_positional, true); }
  constexpr Field omit_empty() const { return with(&Field::is_left_if_empty, true); }
  constexpr Field from(Scope first) const { return with(&Field::scope, first); }
  constexpr Field key(bool present) const { return with(&Field::in_key, std::optional(present)); }
  constexpr Field unset_means(const char* text) const { return with(&Field::default_text, text); }
  constexpr Field or_unset() const { return with(&Field::accepts_unset, true); }
  constexpr Field excludes(const char* other) const { return with(&Field::excluded, other); }
  constexpr Field needs(const char* other) const { return with(&Field::needed, other); }
};

// Thrown if a decoder refuses a value. The message names the field and the expected value.
struct FieldError : Error {
  FieldError(std::string its_field, std::string its_expectation)
      : Error(ErrorCode::kInvalidInput, "'" + its_field + "': expected " + its_expectation),
        field(std::move(its_field)),
        expectation(std::move(its_expectation)) {}

  std::string field, expectation;
};

template <class E>
concept NamedEnum = std::is_enum_v<E> && requires(E e) {
  enum_names(e);
};

// Makes a type usable as a set of names, such as AttributeSet. Members: `names(set)` returns the
// names in the set; `add(set, name)` adds a name, or returns false if the name is unknown; `all()`
// returns all known names.
template <class T>
struct NameSetTraits;
template <class T>
concept NameSet = requires(const T& set) {
  NameSetTraits<T>::names(set);
};

template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};
template <class T>
struct OptionalValue {
  using type = T;
};
template <class T>
struct OptionalValue<std::optional<T>> {
  using type = T;
};
template <class T>
struct IsVector : std::false_type {};
template <class T>
struct IsVector<std::vector<T>> : std::true_type {};
template <class T>
struct IsNumbers : std::false_type {};
template <size_t kCount>
struct IsNumbers<std::array<double, kCount>> : std::true_type {};

// A visitor that does nothing. The concept Described calls `fields` functions with a NoVisitor, so
// these functions may use only the members of NoVisitor.
struct NoVisitor {
  template <class T>
  void operator()(const Field&, T&) {}
  void object(const char*, const auto&) {}
  void derived(const char*, const auto&) {}
};

// A struct that has a `fields` function.
template <class T>
concept Described = requires(T& value, NoVisitor& visitor) {
  fields(visitor, value);
};

// Returns the names of an enumeration's values, without the empty name that means "not given".
template <NamedEnum E>
std::vector<std::string> choices_of(E e = {}) {
  std::vector<std::string> choices;
  for (const std::string_view name : enum_names(e))
    if (!name.empty()) choices.emplace_back(name);
  return choices;
}

template <NamedEnum E>
constexpr const char* name_of(E e) {
  const auto& names = enum_names(e);
  const auto index = static_cast<size_t>(e);
  return index < std::size(names) ? names[index] : "invalid";
}

template <NamedEnum E>
std::optional<E> enum_of(std::string_view text) {
  const auto names = enum_names(E{});
  for (size_t i = 0; i < names.size(); ++i)
    if (text == names[i]) return static_cast<E>(i);
  return std::nullopt;
}

// Returns the words with separators between them: "a, b, c".
std::string joined(const std::vector<std::string>& words, const char* separator = ", ");
// Returns a size as text, in the largest unit that divides it: "64MiB". parse_size() reads this
// text.
std::string exact_size_text(uint64_t bytes);
// Parses a size such as "8GiB" into bytes. Returns nullopt for any other text.
std::optional<uint64_t> size_of_text(const std::string& text);
// Parses a number of voxels per edge such as "4096", "4k", "4Ki" or "1M", where k stands for 1024
// and M for 1024 k. Returns nullopt for any other text.
std::optional<uint64_t> edge_of_text(const std::string& text);
// Returns the number of characters in a UTF-8 text.
size_t character_count(std::string_view text);
// Returns the spelling of a field on the command line: "--hash-bits".
std::string option_name(const char* field_name);

// Returns the values that a field of type T accepts, as a phrase for messages: "a power of two from
// 4 to 1048576".
template <class T>
std::string expectation(const Field& field);
// Returns the values that an integer field accepts, as a phrase for messages. `low` and `high` are
// the field's limits as text.
std::string expected_integer(const Field& field, const std::string& low, const std::string& high);
bool fits_integer_limits(const Field& field, int64_t value);
// True if the text has no control characters and its length is within the limits of the field.
bool is_valid_line(const Field& field, std::string_view text);

template <class T>
std::string expectation(const Field& field) {
  if constexpr (IsOptional<T>::value) {
    return expectation<typename T::value_type>(field);
  } else if constexpr (std::is_same_v<T, bool>) {
    return "true or false";
  } else if constexpr (std::is_integral_v<T>) {
    using Limits = std::numeric_limits<T>;
    return expected_integer(field,
                            field.min ? std::to_string(*field.min) : std::to_string(Limits::min()),
                            field.max ? std::to_string(*field.max) : std::to_string(Limits::max()));
  } else if constexpr (std::is_floating_point_v<T>) {
    if (field.is_above_zero) return "a finite number above 0";
    return field.min ? "a finite number, " + std::to_string(*field.min) + " or more"
                     : "a finite number";
  } else if constexpr (IsNumbers<T>::value) {
    return std::to_string(std::tuple_size_v<T>) + " finite numbers " + field.parts +
           (field.is_above_zero ? ", the last one above 0" : "");
  } else if constexpr (NamedEnum<T>) {
    return "one of " + joined(choices_of<T>());
  } else if constexpr (NameSet<T>) {
    return "names out of " + joined(NameSetTraits<T>::all());
  } else if constexpr (std::is_same_v<T, std::string>) {
    return field.is_line ? "1 to " + std::to_string(*field.max) +
                               " characters of UTF-8 without control characters"
                         : "a text";
  } else if constexpr (IsVector<T>::value) {
    const std::string item = expectation<typename T::value_type>(field);
    return field.max_items ? "1 to " + std::to_string(field.max_items) + " items, each " + item
                           : "a list, each item " + item;
  } else {
    return "an object";
  }
}

// True if a value satisfies the field's limits.
template <class T>
bool fits(const Field& field, const T& value) {
  if constexpr (IsOptional<T>::value) {
    return !value || fits(field, *value);
  } else if constexpr (std::is_same_v<T, bool>) {
    return true;
  } else if constexpr (std::is_integral_v<T>) {
    if (!field.min && !field.max) return true;
    return std::in_range<int64_t>(value) && fits_integer_limits(field, static_cast<int64_t>(value));
  } else if constexpr (std::is_floating_point_v<T>) {
    return std::isfinite(value) && (!field.is_above_zero || value > 0) &&
           (!field.min || value >= static_cast<double>(*field.min));
  } else if constexpr (NamedEnum<T>) {
    return static_cast<size_t>(value) < std::size(enum_names(value));
  } else if constexpr (IsNumbers<T>::value) {
    for (const double number : value)
      if (!std::isfinite(number)) return false;
    return !field.is_above_zero || value.back() > 0;
  } else if constexpr (std::is_same_v<T, std::string>) {
    return !field.is_line || is_valid_line(field, value);
  } else if constexpr (IsVector<T>::value) {
    return (!field.max_items || (!value.empty() && value.size() <= field.max_items)) &&
           std::ranges::all_of(value, [&](const auto& item) { return fits(field, item); });
  } else {
    return true;
  }
}

// Returns the field's default, which is `value`, as text for its documentation. Returns "" if the
// documentation does not mention the default, such as 0 or false.
template <class T>
std::string default_text(const Field& field, const T& value) {
  if (*field.default_text) return field.default_text;
  if constexpr (std::is_same_v<T, bool>) {
    return "";
  } else if constexpr (std::is_integral_v<T>) {
    if (value == 0) return "";
    return field.is_bytes ? exact_size_text(static_cast<uint64_t>(value)) : std::to_string(value);
  } else if constexpr (std::is_floating_point_v<T>) {
    return value == 0 ? "" : number_text(value);
  } else if constexpr (NamedEnum<T>) {
    return name_of(value);
  } else {
    return "";
  }
}

// Returns the documentation of a field: its help, its limits if `has_limits` is true, and its
// default, which is `value`.
template <class T>
std::string documentation(const Field& field, const T& value, bool has_limits) {
  using Inner = typename OptionalValue<T>::type;
  const bool is_limited =
      field.min || field.max || NamedEnum<Inner> || NameSet<Inner> || IsNumbers<Inner>::value;
  std::string text = field.help;
  if (has_limits && is_limited) text += ": " + expectation<T>(field);
  const std::string standard = default_text(field, value);
  return standard.empty() ? text : text + " (default: " + standard + ")";
}

template <class T>
bool is_unset(const Field& field, const T& value) {
  return field.accepts_unset && value == T{};
}

// Parses a value from the command line. Returns false if the text is not a valid value.
template <class T>
bool parse_text(const Field& field, const std::string& text, T& value) {
  if constexpr (IsOptional<T>::value) {
    typename T::value_type inner{};
    if (!parse_text(field, text, inner)) return false;
    value = inner;
  } else if constexpr (std::is_arithmetic_v<T>) {
    if (field.is_bytes) {
      const auto bytes = size_of_text(text);
      if (!bytes) return false;
      value = static_cast<T>(*bytes);
    } else if (field.is_power_of_two) {
      const auto edge = edge_of_text(text);
      if (!edge) return false;
      value = static_cast<T>(*edge);
      if (static_cast<uint64_t>(value) != *edge) return false;
    } else {
      const auto number = parse_numbers<T, 1>(text, ',');
      if (!number) return false;
      value = number->front();
    }
  } else if constexpr (IsNumbers<T>::value) {
    const auto numbers = parse_numbers<double, std::tuple_size_v<T>>(text, ',');
    if (!numbers) return false;
    value = *numbers;
  } else if constexpr (NamedEnum<T>) {
    const auto found = enum_of<T>(text);
    if (!found || (text.empty() && !is_unset(field, *found))) return false;
    value = *found;
  } else if constexpr (NameSet<T>) {
    for (size_t at = 0; at <= text.size() && !is_unset(field, text);) {
      const size_t end = std::min(text.find(',', at), text.size());
      if (!NameSetTraits<T>::add(value, text.substr(at, end - at))) return false;
      at = end + 1;
    }
  } else {
    value = text;
  }
  return is_unset(field, value) || fits(field, value);
}

}  // namespace voxdag
