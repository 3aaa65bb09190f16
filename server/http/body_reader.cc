#include "server/http/body_reader.h"

#include <algorithm>
#include <charconv>

namespace voxdag::server {
namespace {

constexpr size_t kMaxLineBytes = 4096;
constexpr size_t kSizeLineBytes = 18;  // the longest chunk size in hex, and CRLF
constexpr size_t kMaxExtraBytes = 16384;

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
    if (*size == 0) break;
    const BodyEnd end = pass(*size, sink);
    if (end != BodyEnd::kComplete) return end;
    if (!read_line(line) || !line.empty()) return failure();
  }
  do {
    if (!read_line(line)) return failure();
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
  if (!connection_.read_line(line, kMaxLineBytes) || line.find('\r') + 2 != line.size())
    return false;
  extra_bytes_ += line.size() - std::min(line.size(), kSizeLineBytes);
  line.resize(line.size() - 2);
  return extra_bytes_ <= kMaxExtraBytes;
}

BodyEnd BodyReader::failure() const {
  return connection_.error_state() == Connection::ErrorState::kTooSlow ? BodyEnd::kTooSlow
                                                                       : BodyEnd::kBroken;
}

}  // namespace voxdag::server
