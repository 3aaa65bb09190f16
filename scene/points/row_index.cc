#include "scene/points/row_index.h"

#include <algorithm>
#include <string_view>

namespace voxdag::points {

RowIndex::RowIndex(const ReadableFile& file, const std::string& columns, MemoryBudget& budget,
                   const CancelToken& cancel)
    : charge_(budget, "the rows of " + file.path()) {
  RowReader rows(file, budget);
  if (!rows.next()) return;
  set_columns(rows.text(), columns);
  if (has_header_ && !rows.next()) return;
  const RowReader::Place begin = rows.place();
  rows.seek(begin);
  if (columns_.has_colors()) check_colors(rows);
  rows.seek(begin);
  count_rows(rows, cancel);
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

// Sets full_color_, the value of full intensity, from the first rows. If the file has six columns
// without names, the last three are only assumed to be colors. If the first rows have a number in
// these columns that cannot be a color, the file has no colors.
void RowIndex::check_colors(RowReader& rows) {
  double low = 0, high = 0;
  bool has_fraction = false;
  Columns::Values values{};
  for (uint64_t row = 0; row < kBlockRows && rows.next(); ++row) {
    if (!columns_.read(rows.text(), values)) continue;
    low = std::min({low, values[3], values[4], values[5]});
    high = std::max({high, values[3], values[4], values[5]});
    has_fraction = has_fraction || columns_.has_color_fraction(rows.text());
  }
  full_color_ = high <= 1 && has_fraction ? 1 : 255;
  if (are_colors_assumed_ && (low < 0 || high > 255)) columns_ = Columns::standard(false);
}

void RowIndex::count_rows(RowReader& rows, const CancelToken& cancel) {
  for (; rows.next(); ++rows_) {
    if (rows_ % kBlockRows != 0) continue;
    cancel.check();
    charge_.add(sizeof(RowReader::Place));
    blocks_.push_back(rows.place());
  }
}

}  // namespace voxdag::points
