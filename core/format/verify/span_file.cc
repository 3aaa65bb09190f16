#include "core/format/verify/span_file.h"

#include "core/base/error.h"
#include "core/format/checksum.h"

namespace voxdag {

void SpanFile::append(uint64_t span, std::span<const uint32_t> words) {
  Part& part = parts_[span];
  file_.write_at((part.begin + part.words) * sizeof(uint32_t), std::as_bytes(words));
  part.sum += indexed_checksum(part.begin + part.words, words);
  part.words += words.size();
}

void SpanFile::read(uint64_t span, std::span<uint32_t> words) const {
  const Part& part = parts_[span];
  if (words.size() != part.words) damaged(span);
  file_.read_at(part.begin * sizeof(uint32_t), std::as_writable_bytes(words));
  if (indexed_checksum(part.begin, words) != part.sum) damaged(span);
}

void SpanFile::read_piece(uint64_t span, uint64_t first, std::span<uint32_t> words) {
  Part& part = parts_[span];
  if (first + words.size() > part.words) damaged(span);
  file_.read_at((part.begin + first) * sizeof(uint32_t), std::as_writable_bytes(words));
  part.sum -= indexed_checksum(part.begin + first, words);
}

void SpanFile::damaged(uint64_t span) const {
  const Part& part = parts_[span];
  throw Error(ErrorCode::kCorrupt,
              file_.path() + ": the bytes from " + std::to_string(part.begin * sizeof(uint32_t)) +
                  " to " + std::to_string((part.begin + part.words) * sizeof(uint32_t)) +
                  " fail their checksum: expected the bytes that were written");
}

// Makes room for the lists in `buffer`. `end` has the number of items of each list. Afterwards, it
// has the end of each list, and `next` its begin.
void SpanLists::lay_out(Buffer& buffer) const {
  buffer.next.resize(buckets_);
  uint64_t at = 0;
  for (uint64_t bucket = 0; bucket < buckets_; ++bucket, ++at) {
    buffer.next[bucket] = at;
    at += buffer.end[bucket] * item_words_;
  }
  buffer.words.assign(at - 1, 0);
  for (uint64_t bucket = 0; bucket < buckets_; ++bucket) {
    const uint64_t items = buffer.end[bucket];
    if (bucket > 0) buffer.words[buffer.next[bucket] - 1] = static_cast<uint32_t>(items);
    buffer.end[bucket] = buffer.next[bucket] + items * item_words_;
  }
}

std::span<const uint32_t> SpanLists::next(uint64_t span, uint64_t bucket, Buffer& buffer) {
  Cursor& cursor = cursors_[span];
  const bool is_last = bucket + 1 == buckets_;
  const uint64_t words = uint64_t{cursor.items} * item_words_;
  if (cursor.at + words > file_.words(span)) file_.damaged(span);
  buffer.words.resize(words + !is_last);
  file_.read_piece(span, cursor.at, buffer.words);
  cursor.at += static_cast<uint32_t>(buffer.words.size());
  if (is_last)
    file_.finish_pieces(span);
  else
    cursor.items = buffer.words.back();
  return std::span(buffer.words).first(words);
}

}  // namespace voxdag
