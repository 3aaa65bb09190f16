#include "scene/text/line_reader.h"

#include <algorithm>
#include <cstring>
#include <span>

#include "core/base/error.h"
#include "scene/text/characters.h"

namespace voxdag {
namespace {

constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

// True if the text has a "#" that begins a comment.
bool has_comment(std::string_view text) {
  for (size_t i = text.find('#'); i != text.npos; i = text.find('#', i + 1))
    if (i == 0 || is_blank(text[i - 1])) return true;
  return false;
}

// Returns the position of `c` in bytes [begin, end), or `end`.
size_t find_byte(const char* bytes, size_t begin, size_t end, char c) {
  const void* const found = std::memchr(bytes + begin, c, end - begin);
  return found ? static_cast<size_t>(static_cast<const char*>(found) - bytes) : end;
}

}  // namespace

LineReader::LineReader(const ReadableFile& file, MemoryBudget& budget, Join join)
    : file_(file), join_(join), buffer_(budget, kFirstBytes, "the window over " + file.path()) {}

void LineReader::seek(uint64_t offset, uint64_t number) {
  const bool is_in_buffer = offset >= base_ && offset - base_ <= size_;
  if (!is_in_buffer) {
    base_ = offset;
    size_ = 0;
  }
  line_ = next_ = static_cast<size_t>(offset - base_);
  feed_ = kUnknown;
  next_number_ = number;
}

bool LineReader::next() {
  if (base_ + next_ == 0) skip_byte_order_mark();
  line_ = next_;
  number_ = next_number_;
  LineEnd end;
  do {
    end = find_end(next_);
    next_ = end.end;
    ++next_number_;
  } while (join_ == Join::kBackslash && join(end) && end.begin < end.end);
  text_ = {buffer_.data() + line_, end.begin - line_};
  if (!text_.empty() && is_end_mark(text_.back()) && base_ + next_ == file_.size())
    text_ = without_end_marks(text_);
  return next_ > line_;
}

void LineReader::skip_byte_order_mark() {
  line_ = 0;
  if (size_ == 0) load_more();
  if (std::string_view(buffer_.data(), size_).starts_with(kByteOrderMark))
    next_ = kByteOrderMark.size();
}

// Returns the first line end at or after position `from` of the buffer. Loads more of the file if
// necessary, which can move the current line to the beginning of the buffer.
LineReader::LineEnd LineReader::find_end(size_t from) {
  for (;;) {
    if (feed_ == kUnknown || feed_ < from) feed_ = find_byte(buffer_.data(), from, size_, '\n');
    const size_t end = find_byte(buffer_.data(), from, feed_, '\r');
    // The byte after a CR may be an LF, so it must be in the buffer.
    if (end + 1 < size_) return {end, end + (buffer_[end] == '\r' && buffer_[end + 1] == '\n') + 1};
    if (end < size_ && buffer_[end] == '\n') return {end, end + 1};
    if (!load_more()) return {end, std::min(end + 1, size_)};
    from = line_;
  }
}

// Reads more of the file. Moves the current line to the beginning of the buffer, and enlarges the
// buffer if the line fills it. Returns false at the end of the file.
bool LineReader::load_more() {
  if (base_ + size_ >= file_.size()) return false;
  if (line_ == 0 && size_ == buffer_.size()) {
    if (size_ < kMaxLineBytes)
      buffer_.grow(2 * size_, "a long line of " + file_.path());
    else
      skip_comment();
  }
  std::memmove(buffer_.data(), buffer_.data() + line_, size_ - line_);
  base_ += line_;
  size_ -= line_;
  line_ = 0;
  const auto count =
      static_cast<size_t>(std::min<uint64_t>(file_.size() - base_ - size_, buffer_.size() - size_));
  file_.read_at(base_ + size_, std::as_writable_bytes(std::span(buffer_.data() + size_, count)));
  size_ += count;
  feed_ = kUnknown;
  return true;
}

// Drops the bytes of a long comment from the buffer, except for one byte. Replaces this byte by
// "#", so that the line remains a comment.
void LineReader::skip_comment() {
  if (!trimmed({buffer_.data(), size_}).starts_with('#'))
    throw Error(ErrorCode::kLimit, file_.path() + ": line " + std::to_string(number_) +
                                       " has over " + std::to_string(kMaxLineBytes) +
                                       " bytes, expected shorter lines");
  base_ += size_ - 1;
  size_ = 1;
  buffer_[0] = '#';
}

// If the current line ends with a backslash that is not in a comment, replaces the backslash and
// the line end `end` by blanks, and returns true.
bool LineReader::join(LineEnd end) {
  size_t last = end.begin;
  while (last > line_ && is_blank(buffer_[last - 1])) --last;
  if (last == line_ || buffer_[last - 1] != '\\') return false;
  if (has_comment(trimmed({buffer_.data() + line_, last - line_}))) return false;
  std::fill(buffer_.data() + last - 1, buffer_.data() + end.end, ' ');
  return true;
}

}  // namespace voxdag
