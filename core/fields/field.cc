#include "core/fields/field.h"

#include <algorithm>
#include <bit>

#include "core/base/options/option_text.h"
#include "core/base/text/printable.h"

namespace voxdag {

std::string joined(const std::vector<std::string>& words, const char* separator) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : separator) + word;
  return text;
}

std::string exact_size_text(uint64_t bytes) {
  constexpr const char* kUnits[] = {"", "KiB", "MiB", "GiB", "TiB"};
  size_t unit = 0;
  for (; bytes > 0 && bytes % 1024 == 0 && unit + 1 < std::size(kUnits); ++unit) bytes /= 1024;
  return std::to_string(bytes) + kUnits[unit];
}

std::optional<uint64_t> size_of_text(const std::string& text) {
  try {
    return parse_size(text, "");
  } catch (const Error&) {
    return std::nullopt;
  }
}

std::optional<uint64_t> edge_of_text(const std::string& text) {
  constexpr uint64_t kMaxNumber = uint64_t{1} << 40;
  const size_t digits = std::min(text.find_first_not_of("0123456789"), text.size());
  const auto number = parse_numbers<uint64_t, 1>(std::string_view(text).substr(0, digits), ',');
  if (!number || number->front() > kMaxNumber) return std::nullopt;
  std::string unit = text.substr(digits);
  if (unit.size() == 2 && unit[1] == 'i') unit.pop_back();
  if (unit.empty()) return number->front();
  if (unit == "k" || unit == "K") return number->front() << 10;
  if (unit == "M") return number->front() << 20;
  return std::nullopt;
}

size_t character_count(std::string_view text) {
  return static_cast<size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

std::string option_name(const char* field_name) { return spell_for_command_line(field_name, {}); }

std::string expected_integer(const Field& field, const std::string& low, const std::string& high) {
  if (field.is_bytes)
    return field.min ? "a size of at least " + exact_size_text(static_cast<uint64_t>(*field.min)) +
                           ", such as 8GiB"
                     : "a size such as 512MiB or 8GiB";
  if (field.min && !field.max) return "a whole number, " + low + " or more";
  return (field.is_power_of_two ? "a power of two from " : "a whole number from ") + low + " to " +
         high;
}

bool fits_integer_limits(const Field& field, int64_t value) {
  if (field.min && value < *field.min) return false;
  if (field.max && value > *field.max) return false;
  return !field.is_power_of_two || std::has_single_bit(static_cast<uint64_t>(value));
}

bool is_valid_line(const Field& field, std::string_view text) {
  return is_printable(text) &&
         fits_integer_limits(field, static_cast<int64_t>(character_count(text)));
}

}  // namespace voxdag
