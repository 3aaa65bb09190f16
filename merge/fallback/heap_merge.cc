#include "merge/fallback/heap_merge.h"

namespace voxdag {

void OrderedRowWriter::push(const RowKey& row) {
  if (buffer_.full()) flush();
  last_position_ = end_position();
  buffer_.push(row.hash, row.mask, row.words);
  ++nodes_;
  std::copy_n(row.words, format_.words(row.mask), last_words_);
  last_ = {row.hash, row.mask, last_words_};
  any_ = true;
}

void OrderedRowWriter::flush() {
  if (buffer_.row_count() == 0) return;
  output_.add(buffer_);
  output_.write(flushed_, buffer_);
  flushed_ += buffered_positions();
  buffer_.clear();
}

}  // namespace voxdag
