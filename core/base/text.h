// Converts between values and text: sizes, counts, durations, lists of numbers, hexadecimal and
// percent-encoded bytes. Pure functions.
#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

namespace voxdag {

// Parses a size in bytes, such as "512MiB", "8GiB", "64M" (the same as "64MiB") or "1000000".
// Throws Error{kInvalidInput} unless the text is a number with an optional unit. The message begins
// with `option`, the name of the option.
uint64_t parse_size(const std::string& text, const std::string& option);
// Returns a size as text: "1.25 GiB".
std::string size_text(uint64_t bytes);
// Returns a count as text: "2 567 687 158".
std::string count_text(uint64_t count);
// Returns a duration as text: "1 m 04 s" or "12.3 s".
std::string duration_text(double seconds);

// Returns the shortest text that parses to the same number. The text does not depend on the locale.
std::string number_text(double number);

// Formats a Unix time in UTC, with a format of strftime().
std::string utc_text(time_t time, const char* format);

// Returns bytes as text: two lower-case hexadecimal digits per byte.
std::string hex_text(std::span<const unsigned char> bytes);
// Decodes a percent-encoded text (RFC 3986). Returns nullopt if a '%' is not followed by two
// hexadecimal digits.
std::optional<std::string> percent_decoded(std::string_view text);

// Parses `text` as exactly kCount numbers with `separator` between them. Returns nullopt for any
// other text.
template <class Number, size_t kCount>
std::optional<std::array<Number, kCount>> parse_numbers(std::string_view text, char separator) {
  std::array<Number, kCount> numbers{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (size_t i = 0; i < kCount; ++i) {
    if (i > 0 && (at == end || *at++ != separator)) return std::nullopt;
    const auto [stop, failure] = std::from_chars(at, end, numbers[i]);
    if (failure != std::errc{}) return std::nullopt;
    at = stop;
  }
  if (at != end) return std::nullopt;
  return numbers;
}

}  // namespace voxdag
