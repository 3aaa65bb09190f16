#include "core/base/text.h"

#include <cmath>
#include <cstdio>

#include "core/base/error.h"

namespace voxdag {
namespace {

constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB", "PiB"};

// Returns the exponent e of a unit of 2^e bytes ("", "B", "K", "KiB", "kB", ...): 10 for "KiB".
// Returns -1 for other texts.
int unit_shift(std::string unit) {
  if (unit.ends_with("B") || unit.ends_with("b")) unit.pop_back();
  if (unit.ends_with("i")) unit.pop_back();
  if (unit.empty()) return 0;
  if (unit.size() != 1) return -1;
  const size_t at = std::string("KMGTP").find(static_cast<char>(std::toupper(unit[0])));
  return at == std::string::npos ? -1 : 10 * static_cast<int>(at + 1);
}

// Returns the value of a hexadecimal digit, or -1.
int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

}  // namespace

uint64_t parse_size(const std::string& text, const std::string& option) {
  double number = 0;
  const auto [rest, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  std::string unit(rest, text.data() + text.size());
  while (!unit.empty() && unit.front() == ' ') unit.erase(0, 1);
  const int shift = unit_shift(unit);
  const double bytes = shift < 0 ? -1 : std::ldexp(number, shift);
  if (failure != std::errc{} || !(bytes >= 0) || bytes >= 0x1p63)
    throw Error(ErrorCode::kInvalidInput,
                option + " '" + text + "': expected a size such as 512MiB or 8GiB");
  return static_cast<uint64_t>(bytes);
}

std::string size_text(uint64_t bytes) {
  double value = static_cast<double>(bytes);
  int unit = 0;
  for (; value >= 1024 && unit < 5; ++unit) value /= 1024;
  char text[48];
  std::snprintf(text, sizeof text, unit == 0 ? "%.0f %s" : "%.2f %s", value, kUnits[unit]);
  return text;
}

std::string count_text(uint64_t count) {
  const std::string digits = std::to_string(count);
  std::string text;
  for (size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text += ' ';
    text += digits[i];
  }
  return text;
}

std::string duration_text(double seconds) {
  char text[48];
  const long whole = std::lround(seconds);
  if (whole >= 3600)
    std::snprintf(text, sizeof text, "%ld h %02ld m", whole / 3600, whole / 60 % 60);
  else if (whole >= 60)
    std::snprintf(text, sizeof text, "%ld m %02ld s", whole / 60, whole % 60);
  else
    std::snprintf(text, sizeof text, "%.1f s", seconds);
  return text;
}

std::string number_text(double number) {
  char text[40];
  return {text, std::to_chars(text, text + sizeof text, number).ptr};
}

std::string utc_text(time_t time, const char* format) {
  tm parts{};
  gmtime_r(&time, &parts);
  char text[64];
  return std::string(text, std::strftime(text, sizeof text, format, &parts));
}

std::string hex_text(std::span<const unsigned char> bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const unsigned char byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

std::optional<std::string> percent_decoded(std::string_view text) {
  std::string bytes;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      bytes += text[i];
      continue;
    }
    const int high = i + 2 < text.size() ? hex_digit(text[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(text[i + 2]) : -1;
    if (low < 0) return std::nullopt;
    bytes += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return bytes;
}

}  // namespace voxdag
