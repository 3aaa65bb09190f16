// The rows of a text file with points: their columns, their number, and the position in the file of
// every 1024th row.
#pragma once

#include <cstdint>
#include <deque>
#include <string>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/growing_charge.h"
#include "scene/points/columns.h"
#include "scene/points/row_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag::points {

class RowIndex {
 public:
  static constexpr uint64_t kBlockRows = 1024;

  // `columns` names the columns (SceneOptions::columns); if it is empty, the first row decides.
  // Throws Error{kInvalidInput} if `columns` is invalid, Error{kOutOfMemory} if the positions of
  // the rows do not fit the budget.
  RowIndex(const ReadableFile& file, const std::string& columns, MemoryBudget& budget,
           const CancelToken& cancel);

  const Columns& columns() const { return columns_; }
  // Returns the number that means full intensity of a color: 1 or 255.
  double full_color() const { return full_color_; }
  uint64_t rows() const { return rows_; }
  // Returns the positions of the rows 0, kBlockRows, 2 * kBlockRows, ...
  const std::deque<RowReader::Place>& blocks() const { return blocks_; }

 private:
  void set_columns(std::string_view first_row, const std::string& names);
  void check_colors(RowReader& rows);
  void count_rows(RowReader& rows, const CancelToken& cancel);

  Columns columns_ = Columns::standard(false);
  bool has_header_ = false;
  bool are_colors_assumed_ = false;  // six columns without names: the last three may be colors
  double full_color_ = 255;
  uint64_t rows_ = 0;
  std::deque<RowReader::Place> blocks_;
  GrowingCharge charge_;  // charge for the blocks
};

}  // namespace voxdag::points
