#include "server/http/exchange.h"

#include <sys/time.h>

#include <algorithm>
#include <charconv>
#include <ctime>

#include "core/base/integers.h"
#include "server/random_id.h"

namespace voxdag::server {
namespace {

constexpr size_t kReadBytes = 256 << 10;  // of a file per write to the socket

std::string http_date() {
  const time_t now = time(nullptr);
  tm parts{};
  gmtime_r(&now, &parts);
  char text[40];
  const size_t size = strftime(text, sizeof text, "%a, %d %b %Y %H:%M:%S GMT", &parts);
  return std::string(text, size);
}

Problem problem_of_status(int status) {
  switch (status) {
    case 404:
      return not_found("no such resource");
    case 413:
      return Problem(413, "too_large", "the body is too large");
    case 414:
      return problem(ErrorCode::kInvalidInput, "the request target is longer than 8192 bytes");
    case 416:
      return Problem(416, "range_not_satisfiable", "the Range header is malformed");
    case 500:
      return Problem(500, "internal", "internal error");
    default:
      return bad_request("expected an HTTP/1.1 request");
  }
}

// Sends the pieces one after the other.
httplib::ContentProvider provide(std::shared_ptr<ReadableFile> file,
                                 std::vector<FilePiece> pieces) {
  return [file = std::move(file), pieces = std::move(pieces), buffer = std::string()](
             size_t offset, size_t, httplib::DataSink& sink) mutable {
    uint64_t skip = offset;
    for (const FilePiece& piece : pieces) {
      if (skip < piece.text.size())
        return sink.write(piece.text.data() + skip, piece.text.size() - skip);
      skip -= piece.text.size();
      if (skip < piece.range.size()) {
        buffer.resize(std::min<uint64_t>(kReadBytes, piece.range.size() - skip));
        try {
          file->read_at(piece.range.begin + skip, std::as_writable_bytes(std::span(buffer)));
        } catch (const Error&) {
          return false;  // the status is already sent: all that is left is to abort the answer
        }
        return sink.write(buffer.data(), buffer.size());
      }
      skip -= piece.range.size();
    }
    return false;
  };
}

httplib::ContentProviderWithoutLength provide(EventSource next, const Connection& connection) {
  return [next = std::move(next), &connection](size_t, httplib::DataSink& sink) {
    const auto text = next();
    if (!text) {
      sink.done();
      return true;
    }
    if (text->empty()) return !connection.peer_disconnected();
    return sink.write(text->data(), text->size());
  };
}

}  // namespace

Exchange::Exchange(Connection& connection, const std::string& address) : connection_(connection) {
  request_.peer = address;
  request_.id = random_id();
}

void Exchange::begin(httplib::Request& raw) {
  begun_ = true;
  connection_.begin_exchange();
  request_.method = raw.method;
  target_ = raw.target;
  for (const auto& [name, value] : raw.headers)
    if (name != "REMOTE_ADDR" && name != "REMOTE_PORT") request_.headers.emplace(name, value);
  const auto lengths = request_.headers.count("Content-Length");
  if (lengths > 0) {
    const std::string text = request_.header("Content-Length");
    uint64_t length = 0;
    const auto parsed = std::from_chars(text.data(), text.data() + text.size(), length);
    if (lengths > 1 || parsed.ec != std::errc{} || parsed.ptr != text.data() + text.size())
      framing_error_ = "Content-Length: expected one number";
    request_.content_length = length;
  }
  if (request_.headers.contains("Transfer-Encoding")) {
    chunked_ = equal_ignoring_case(request_.header("Transfer-Encoding"), "chunked") &&
               request_.headers.count("Transfer-Encoding") == 1;
    if (!chunked_ || lengths > 0) framing_error_ = "Transfer-Encoding: expected chunked alone";
  }
  request_.has_body = chunked_ || request_.content_length.value_or(0) > 0;
  raw.path = "/";
  raw.ranges.clear();
  raw.headers.erase("Accept-Encoding");
  raw.headers.erase("Content-Type");  // httplib would parse forms
}

void Exchange::check(const httplib::ContentReader* reader) {
  if (!framing_error_.empty()) throw bad_request(framing_error_);
  if (request_.headers.contains("Content-Encoding"))
    throw Problem(415, "unsupported_media_type", "expected a body without Content-Encoding");
  request_.target = parse_target(target_);
  request_.read_body = [this, reader](const Request::Sink& sink) {
    if (!reader || !request_.has_body) return BodyEnd::kComplete;
    bool stopped = false;
    read_to_end_ = (*reader)([&](const char* data, size_t size) {
      stopped = !sink(std::string_view(data, size));
      return !stopped;
    });
    if (read_to_end_) return BodyEnd::kComplete;
    if (stopped) return BodyEnd::kStopped;
    return connection_.error_state() == Connection::ErrorState::kTooSlow ? BodyEnd::kTooSlow
                                                                         : BodyEnd::kBroken;
  };
}

void Exchange::answer(Response response, httplib::Response& out, bool last) {
  answered_ = true;
  out.status = response.status;
  for (const auto& [name, value] : response.headers) out.headers.emplace(name, value);
  add_standard_headers(out);
  if (last || !is_complete()) out.set_header("Connection", "close");
  const std::string type = header_value(response.headers, "Content-Type");
  if (response.file) {
    uint64_t size = 0;
    for (const FilePiece& piece : response.pieces) size += piece.text.size() + piece.range.size();
    out.headers.erase("Content-Type");
    out.set_content_provider(size, type,
                             provide(std::move(response.file), std::move(response.pieces)),
                             [permit = std::move(response.permit)](bool) {});
  } else if (response.next_event) {
    out.headers.erase("Content-Type");
    out.set_chunked_content_provider(type, provide(std::move(response.next_event), connection_),
                                     [permit = std::move(response.permit)](bool) {});
  } else {
    out.body = std::move(response.body);
  }
}

void Exchange::answer_error(httplib::Response& out) {
  answered_ = true;
  Problem problem = problem_of_status(out.status);
  if (connection_.error_state() == Connection::ErrorState::kHeaderTooLarge)
    problem = Problem(431, "headers_too_large", "the header fields are too large");
  if (connection_.error_state() == Connection::ErrorState::kTooSlow)
    problem = Problem(408, "timeout", "the request was sent too slowly");
  out.status = problem.status;
  out.body = problem_json(problem);
  out.headers.erase("Content-Type");
  out.set_header("Content-Type", "application/problem+json");
  add_standard_headers(out);
}

void Exchange::add_standard_headers(httplib::Response& out) const {
  out.set_header("X-Request-Id", request_.id);
  out.set_header("Date", http_date());
  out.set_header("X-Content-Type-Options", "nosniff");
  out.set_header("Referrer-Policy", "no-referrer");
  if (!out.has_header("Content-Security-Policy"))
    out.set_header("Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'");
}

bool Exchange::is_complete() const {
  if (!begun_ || !framing_error_.empty()) return false;
  if (chunked_) return read_to_end_;
  return connection_.body_bytes() == request_.content_length.value_or(0);
}

void Exchange::send_error() {
  if (begun_ || answered_) return;
  httplib::Response out;
  out.status = 400;
  if (connection_.error_state() == Connection::ErrorState::kNone) return;
  answer_error(out);
  std::string text = "HTTP/1.1 " + std::to_string(out.status) + " " + status_title(out.status) +
                     "\r\nContent-Type: application/problem+json\r\nConnection: close\r\n" +
                     "Content-Length: " + std::to_string(out.body.size()) + "\r\n\r\n" + out.body;
  connection_.write(text.data(), text.size());
}

}  // namespace voxdag::server
