#include "merge/fallback/cursor_merge.h"

namespace voxdag {

void OrderedRows::push(const RowKey& row) {
  if (batch_.row_room() == 0) flush();
  last_position_ = end_position();
  batch_.push(row.hash, row.mask, row.words);
  ++nodes_;
  std::copy_n(row.words, kRowWords[row.mask], last_words_);
  last_ = {row.hash, row.mask, last_words_};
  any_ = true;
}

void OrderedRows::flush() {
  if (batch_.row_count() == 0) return;
  output_.add(batch_);
  output_.write(flushed_, batch_);
  flushed_ += batch_extent();
  batch_.clear();
}

}  // namespace voxdag
