#include "scene/points/line_reader.h"

#include <algorithm>
#include <string>

#include "core/base/error.h"
#include "scene/text/characters.h"

namespace voxdag::points {
namespace {

// Returns the number of bytes before the first line end.
size_t bytes_of_line(std::string_view text) {
  size_t size = 0;
  while (size < text.size() && !is_line_end(text[size])) ++size;
  return size;
}

}  // namespace

bool LineReader::next() {
  while (next_.offset < window_.file().size()) {
    place_ = next_;
    const std::string_view line = read_line();
    next_.offset += line.size();
    text_ = trimmed(line);
    const bool is_skipped = is_comment(text_);
    skip_line_end();
    if (!is_skipped) return true;
  }
  return false;
}

// Returns the line at next_.
std::string_view LineReader::read_line() {
  const auto line_in = [](std::span<const std::byte> bytes) {
    return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  std::string_view bytes = line_in(window_.at(next_.offset, 1));
  size_t size = bytes_of_line(bytes);
  // Two more bytes for the line end, so that skip_line_end() does not move the window.
  if (size + 2 > bytes.size() && next_.offset + bytes.size() < window_.file().size()) {
    bytes = line_in(window_.at(next_.offset, kMaxLine + 2));
    size = bytes_of_line(bytes);
  }
  if (size > kMaxLine)
    throw Error(ErrorCode::kLimit, window_.file().path() + ": line " + std::to_string(next_.line) +
                                       " has more than " + std::to_string(kMaxLine) + " bytes");
  return bytes.substr(0, size);
}

void LineReader::skip_line_end() {
  const char first = at(next_.offset);
  if (!is_line_end(first)) return;  // the end of the file
  ++next_.offset;
  ++next_.line;
  if (first == '\r' && at(next_.offset) == '\n') ++next_.offset;
}

// Returns 0 after the end of the file.
char LineReader::at(uint64_t offset) {
  const auto bytes = window_.at(offset, 1);
  return bytes.empty() ? '\0' : static_cast<char>(bytes[0]);
}

bool is_comment(std::string_view text) {
  return text.empty() || text.front() == '#' || text.starts_with("//");
}

}  // namespace voxdag::points
