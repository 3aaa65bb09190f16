#include "cli/service/table_text.h"

#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>

namespace voxdag::cli {
namespace {

constexpr const char* kEllipsis = "\xe2\x80\xa6";

// Returns the length of the character that begins at `at`: one byte, and all bytes that continue
// it.
size_t length_at(const std::string& text, size_t at) {
  constexpr size_t kMaxLength = 4;
  size_t end = at + 1;
  while (end < text.size() && end - at < kMaxLength &&
         (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80)
    ++end;
  return end - at;
}

// Returns the code point of a character. For invalid UTF-8, returns any number.
uint32_t code_point(const std::string& text, size_t at, size_t length) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(text[at + i]); };
  if (length == 1) return byte(0);
  uint32_t code = byte(0) & (0xffu >> (length + 1));
  for (size_t i = 1; i < length; ++i) code = code << 6 | (byte(i) & 0x3fu);
  return code;
}

// Returns the number of columns of a character. The ranges are the blocks of Unicode whose
// characters are mostly wide, and the blocks of combining characters.
size_t columns_of(uint32_t code) {
  const auto is_in = [code](uint32_t first, uint32_t last) {
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
    const size_t length = length_at(text, at);
    used += columns_of(code_point(text, at, length));
    if (used > columns) return columns == 0 ? "" : text.substr(0, cut) + kEllipsis;
    at += length;
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
