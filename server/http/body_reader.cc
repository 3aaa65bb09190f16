#include "server/http/body_reader.h"

#include <algorithm>
#include <charconv>

namespace voxdag::server {
namespace {

constexpr size_t kMaxLineBytes = 4096;
// kMaxExtraBytes limits the bytes of a body outside its content: extensions of chunks, the size
// line of the last chunk, and trailers with their line ends. In the size line of a chunk with
// content, the first kMaxSizeDigits bytes are not counted. They are enough for the longest size in
// hex, and need no limit, because at least one byte of content follows the line.
constexpr size_t kMaxSizeDigits = 16;
constexpr size_t kMaxExtraBytes = 16384;
constexpr size_t kLineEndBytes = 2;

// Parses the size of a chunk from its line, "1f40" or "1f40;extension"; nullopt if it is malformed.
std::optional<uint64_t> chunk_size(std::string_view line) {
  uint64_t size = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), size, 16);
  if (error != std::errc{}) return {};
  const std::string_view rest = trimmed(line.substr(static_cast<size_t>(end - line.data())));
  if (!rest.empty() && !rest.starts_with(';')) return {};
  for (const char c : rest)
    if (static_cast<unsigned char>(c) < ' ' && c != '\t') return {};
  return size;
}

}  // namespace

BodyReader::BodyReader(Connection& connection, const RequestHead& head)
    : connection_(connection),
      length_(head.content_length.value_or(0)),
      chunked_(head.chunked),
      expects_continue_(head.expects_continue),
      complete_(!chunked_ && length_ == 0) {}

BodyEnd BodyReader::read(const Request::Sink& sink) {
  if (complete_) return BodyEnd::kComplete;
  if (expects_continue_ && !connection_.write("HTTP/1.1 100 Continue\r\n\r\n")) return failure();
  const BodyEnd end = chunked_ ? read_chunks(sink) : pass(length_, sink);
  complete_ = end == BodyEnd::kComplete;
  return end;
}

BodyEnd BodyReader::read_chunks(const Request::Sink& sink) {
  std::string line;
  for (;;) {
    if (!read_line(line)) return failure();
    const auto size = chunk_size(line);
    if (!size) return BodyEnd::kBroken;
    const size_t free_bytes = *size > 0 ? kMaxSizeDigits : 0;
    if (!count_extra(line.size() - std::min(line.size(), free_bytes))) return BodyEnd::kBroken;
    if (*size == 0) break;
    const BodyEnd end = pass(*size, sink);
    if (end != BodyEnd::kComplete) return end;
    if (!read_line(line) || !line.empty()) return failure();
  }
  do {
    if (!read_line(line) || !count_extra(line.size() + kLineEndBytes)) return failure();
  } while (!line.empty());
  return BodyEnd::kComplete;
}

BodyEnd BodyReader::pass(uint64_t bytes, const Request::Sink& sink) {
  while (bytes > 0) {
    const std::string_view piece = connection_.read(bytes);
    if (piece.empty()) return failure();
    bytes -= piece.size();
    if (!sink(piece)) return BodyEnd::kStopped;
  }
  return BodyEnd::kComplete;
}

bool BodyReader::read_line(std::string& line) {
  line.clear();
  const bool ended = connection_.read_line(line, kMaxLineBytes);
  const bool is_too_long = !ended && connection_.error_state() == Connection::ErrorState::kNone;
  if (is_too_long) connection_.close_without_linger();
  if (!ended || line.find('\r') + 2 != line.size()) return false;
  line.resize(line.size() - kLineEndBytes);
  return true;
}

bool BodyReader::count_extra(size_t bytes) {
  extra_bytes_ += bytes;
  if (extra_bytes_ > kMaxExtraBytes) connection_.close_without_linger();
  return extra_bytes_ <= kMaxExtraBytes;
}

BodyEnd BodyReader::failure() const {
  return connection_.error_state() == Connection::ErrorState::kTooSlow ? BodyEnd::kTooSlow
                                                                       : BodyEnd::kBroken;
}

}  // namespace voxdag::server
