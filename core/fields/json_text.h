// Converts JSON to text and text to JSON. The functions are defined for nlohmann::json and
// nlohmann::ordered_json, and are compiled only once. A file that calls dump() or parse() of these
// classes instead takes seconds longer to compile.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace voxdag {

// Returns the text of the value: on one line if `indent` is -1, and otherwise on several lines that
// are indented by `indent` spaces per level. Replaces invalid UTF-8, which paths and strings of
// scenes can contain, by U+FFFD.
template <class Json>
std::string json_text(const Json& value, int indent = -1);
// Returns the text as json_text() writes it: bytes that are not valid UTF-8 become U+FFFD.
std::string as_utf8(const std::string& text);
// Like json_text() on one line, but escapes all characters outside of ASCII.
template <class Json>
std::string ascii_json_text(const Json& value);
// Like json_text(), but throws Json::type_error if a string is not valid UTF-8.
template <class Json>
std::string exact_json_text(const Json& value, int indent = -1);

// Returns the value of the text. Throws Json::parse_error if the text is not JSON.
template <class Json>
Json parse_json(std::string_view text);
// Returns the value of the text. If the text is not JSON, is_discarded() is true for the returned
// value.
template <class Json>
Json try_parse_json(std::string_view text);

// Returns the first name that occurs twice in one object of the text, which the parsers accept.
// Returns nullopt if there is none, or if the text is not JSON.
std::optional<std::string> repeated_member(std::string_view text);

}  // namespace voxdag
