#include "scene/text/numbers.h"

#include <charconv>
#include <clocale>
#include <cstdlib>
#include <limits>
#include <string>

namespace voxdag {
namespace {

// Removes a leading plus sign, which std::from_chars does not accept. "+-1" remains invalid.
std::string_view without_plus(std::string_view text) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  return text;
}

// Returns the locale whose decimal point is "." for strtod_l(). A program that links this library
// may have set another locale.
locale_t c_locale() {
  static const locale_t locale = newlocale(LC_ALL_MASK, "C", nullptr);
  return locale;
}

// Returns NaN or infinity for a text such as "-1.#IND", "1.#QNAN0" or "1.#INF", which old C
// libraries of Windows write.
std::optional<double> parse_windows_special(std::string_view text) {
  const bool is_negative = text.starts_with('-');
  if (is_negative) text.remove_prefix(1);
  if (!text.starts_with("1.#")) return std::nullopt;
  text.remove_prefix(3);
  while (text.ends_with('0')) text.remove_suffix(1);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (text == "INF") return is_negative ? -kInfinity : kInfinity;
  if (text == "IND" || text == "QNAN" || text == "SNAN")
    return std::numeric_limits<double>::quiet_NaN();
  return std::nullopt;
}

}  // namespace

std::optional<int64_t> parse_integer(std::string_view text) {
  text = without_plus(text);
  int64_t value = 0;
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, value);
  if (parsed.ptr != end || parsed.ec != std::errc()) return std::nullopt;
  return value;
}

template <class T>
std::optional<double> parse_real(std::string_view text) {
  text = without_plus(text);
  T value{};
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, value);
  if (parsed.ptr != end || parsed.ec == std::errc::invalid_argument)
    return parse_windows_special(text);
  // The number is too large or too close to zero. strtod_l() returns infinity or a value near zero.
  if (parsed.ec == std::errc::result_out_of_range)
    return static_cast<T>(strtod_l(std::string(text).c_str(), nullptr, c_locale()));
  return value;
}
template std::optional<double> parse_real<float>(std::string_view text);
template std::optional<double> parse_real<double>(std::string_view text);

}  // namespace voxdag
