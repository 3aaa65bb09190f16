// Texts of the tables that commands of the service print.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace voxdag::cli {

// Returns the time since a moment, such as "45 s", "12 min", "3 h" or "5 d", rounded down.
// `moment` is a time of the service, such as "2026-11-21T07:00:00.123Z". Returns "" for other text,
// and "0 s" for a moment in the future, because the clocks of two machines can differ. `now_s` is a
// Unix time.
std::string age_text(const std::string& moment, double now_s);

// Returns `text` (UTF-8) if it needs at most `columns` columns of a terminal; otherwise its begin
// and "…", together at most `columns` columns. Most characters of Chinese, Japanese and Korean
// text, and emoji, need two columns.
std::string cut_to_columns(const std::string& text, size_t columns);

// Returns the lines of a table. `align` has a character for each cell of a row: 'l' aligns it left,
// and 'r' right. Each column is as wide as its widest cell. If a line would be longer than
// `columns`, its last cell is cut. If less than 20 columns would remain for the last cells, the
// cells before them are also cut, to 8 columns or more. 0 columns: nothing is cut.
std::vector<std::string> table_lines(const std::vector<std::vector<std::string>>& rows,
                                     std::string_view align, size_t columns);

// Returns the number of columns if standard output is a terminal that has a size; otherwise 0.
size_t terminal_columns();

}  // namespace voxdag::cli
