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
constexpr std::string_view kGap = "  ";  // between two cells of a table
constexpr size_t kMinLastColumns = 20, kMinCutColumns = 8;

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

size_t columns_of(std::string_view text) {
  size_t columns = 0;
  while (!text.empty()) {
    const Character character = first_character(text);
    columns += columns_of(character.code);
    text.remove_prefix(character.bytes);
  }
  return columns;
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

std::vector<std::string> table_lines(const std::vector<std::vector<std::string>>& rows,
                                     std::string_view align, size_t columns) {
  const size_t last = align.size() - 1;
  std::vector<size_t> widths(align.size(), 0);
  for (const auto& row : rows)
    for (size_t i = 0; i < align.size(); ++i) widths[i] = std::max(widths[i], columns_of(row[i]));
  size_t begin = 0;  // column at which the last cells begin
  for (size_t i = 0; i < last; ++i) begin += widths[i] + kGap.size();
  const size_t wanted = begin + std::min(widths[last], kMinLastColumns);
  if (columns > 0 && wanted > columns) {
    size_t& cut = widths[last - 1];
    cut = std::min(cut, std::max(kMinCutColumns, cut - std::min(cut, wanted - columns)));
  }
  std::vector<std::string> lines;
  for (const auto& row : rows) {
    std::string line;
    for (size_t i = 0; i < last; ++i) {
      const std::string cell = cut_to_columns(row[i], widths[i]);
      const std::string padding(widths[i] - columns_of(cell), ' ');
      line += (align[i] == 'r' ? padding + cell : cell + padding) + std::string(kGap);
    }
    line += row[last];
    lines.push_back(columns > 0 ? cut_to_columns(line, columns) : line);
  }
  return lines;
}

size_t terminal_columns() {
  struct winsize size {};
  if (isatty(STDOUT_FILENO) != 1 || ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0) return 0;
  return size.ws_col;
}

}  // namespace voxdag::cli
