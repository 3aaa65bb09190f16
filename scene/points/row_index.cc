#include "scene/points/row_index.h"

#include <algorithm>
#include <array>
#include <span>
#include <string_view>

namespace voxdag::points {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

// Returns the place of the first line, after the byte order mark of UTF-8 if there is one.
LineReader::Place first_line(const ReadableFile& file) {
  std::array<char, kByteOrderMark.size()> first{};
  if (file.size() < first.size()) return {};
  file.read_at(0, std::as_writable_bytes(std::span(first)));
  const bool has_mark = std::string_view(first.data(), first.size()) == kByteOrderMark;
  return {has_mark ? kByteOrderMark.size() : 0, 1};
}

}  // namespace

RowIndex::RowIndex(const ReadableFile& file, const std::string& columns, MemoryBudget& budget,
                   const CancelToken& cancel)
    : charge_(budget, "the rows of " + file.path()) {
  LineReader lines(file, budget);
  lines.seek(first_line(file));
  if (!lines.next()) return;
  set_columns(lines.text(), columns);
  const LineReader::Place begin = has_header_ ? lines.end() : lines.place();
  lines.seek(begin);
  if (columns_.has_colors()) check_colors(lines);
  lines.seek(begin);
  count_rows(lines, cancel);
}

void RowIndex::set_columns(std::string_view first_row, const std::string& names) {
  if (!names.empty()) {
    columns_ = Columns::given(names);
    has_header_ = columns_.has_no_number(first_row);
  } else if (const auto header = Columns::of_header(first_row)) {
    columns_ = *header;
    has_header_ = true;
  } else {
    are_colors_assumed_ = count_numbers(first_row) == 6;
    columns_ = Columns::standard(are_colors_assumed_);
  }
}

// Sets full_color_ from the first rows. If the colors are only assumed, and one of these rows has a
// number that is not a color, the columns get no colors.
void RowIndex::check_colors(LineReader& lines) {
  double low = 0, high = 0;
  bool has_fraction = false;
  Columns::Values values{};
  for (uint64_t row = 0; row < kBlockRows && lines.next(); ++row) {
    if (!columns_.read(lines.text(), values)) continue;
    low = std::min({low, values[3], values[4], values[5]});
    high = std::max({high, values[3], values[4], values[5]});
    has_fraction = has_fraction || columns_.has_color_fraction(lines.text());
  }
  full_color_ = high <= 1 && has_fraction ? 1 : 255;
  if (are_colors_assumed_ && (low < 0 || high > 255)) columns_ = Columns::standard(false);
}

void RowIndex::count_rows(LineReader& lines, const CancelToken& cancel) {
  for (; lines.next(); ++rows_) {
    if (rows_ % kBlockRows != 0) continue;
    cancel.check();
    charge_.add(sizeof(LineReader::Place));
    blocks_.push_back(lines.place());
  }
}

}  // namespace voxdag::points
