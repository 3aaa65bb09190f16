#include "cli/service/table_text.h"

#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <string_view>

#include "core/base/text/utf8.h"

namespace voxdag::cli {
namespace {

constexpr const char* kEllipsis = "\xe2\x80\xa6";

// Returns the number of columns of a character. The ranges are the blocks of Unicode whose
// characters are mostly wide, and the blocks of combining characters.
size_t columns_of(char32_t code) {
  const auto is_in = [code](char32_t first, char32_t last) {
    return code >= first && code <= last;
  };
  if (is_in(0x300, 0x36f) || is_in(0x200b, 0x200f) || is_in(0xfe00, 0xfe0f)) return 0;
  const bool is_wide = is_in(0x1100, 0x115f) || is_in(0x2e80, 0xa4cf) || is_in(0xac00, 0xd7a3) ||
                       is_in(0xf900, 0xfaff) || is_in(0xfe30, 0xfe6f) || is_in(0xff00, 0xff60) ||
                       is_in(0xffe0, 0xffe6) || is_in(0x1f300, 0x1faff) || is_in(0x20000, 0x3fffd);
  return is_wide ? 2 : 1;
}

}  // namespace

std::string age_text(const std::string& moment, double now_s) {
  struct tm utc {};
  char end = 0;
  if (std::sscanf(moment.c_str(), "%4d-%2d-%2dT%2d:%2d:%2d%c", &utc.tm_year, &utc.tm_mon,
                  &utc.tm_mday, &utc.tm_hour, &utc.tm_min, &utc.tm_sec, &end) != 7)
    return "";
  utc.tm_year -= 1900;
  utc.tm_mon -= 1;
  const auto age = static_cast<int64_t>(std::max(0.0, now_s - static_cast<double>(timegm(&utc))));
  if (age < 60) return std::to_string(age) + " s";
  if (age < 60 * 60) return std::to_string(age / 60) + " min";
  if (age < 24 * 60 * 60) return std::to_string(age / (60 * 60)) + " h";
  return std::to_string(age / (24 * 60 * 60)) + " d";
}

std::string cut_to_columns(const std::string& text, size_t columns) {
  size_t used = 0, cut = 0;  // `cut`: end of the part that fits together with the ellipsis
  for (size_t at = 0; at < text.size();) {
    const Character character = first_character(std::string_view(text).substr(at));
    used += columns_of(character.code);
    if (used > columns) return columns == 0 ? "" : text.substr(0, cut) + kEllipsis;
    at += character.bytes;
    if (used < columns) cut = at;
  }
  return text;
}

size_t terminal_columns() {
  struct winsize size {};
  if (isatty(STDOUT_FILENO) != 1 || ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0) return 0;
  return size.ws_col;
}

}  // namespace voxdag::cli
