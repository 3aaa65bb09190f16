#include "server/http/exchange.h"

#include <algorithm>
#include <cstdio>
#include <ctime>

#include "core/base/error.h"
#include "core/io/random_id.h"
#include "server/http/message/problem.h"

namespace voxdag::server {
namespace {

constexpr size_t kReadBytes = 256 << 10;  // bytes of a file per write to the socket

std::string http_date() {
  const time_t now = time(nullptr);
  tm parts{};
  gmtime_r(&now, &parts);
  char text[40];
  const size_t size = strftime(text, sizeof text, "%a, %d %b %Y %H:%M:%S GMT", &parts);
  return std::string(text, size);
}

std::string chunk_line(size_t size) {
  char line[24];
  std::snprintf(line, sizeof line, "%zx\r\n", size);
  return line;
}

bool has_content(const Response& response) {
  return response.status != 204 && response.status != 304;
}

}  // namespace

Exchange::Exchange(Connection& connection, const std::string& address) : connection_(connection) {
  request_.peer = address;
  request_.id = random_id();
}

Request& Exchange::read_request(size_t max_header_bytes) {
  head_ = parse_request_head(read_head(max_header_bytes));
  connection_.begin_exchange();
  body_.emplace(connection_, head_);
  request_.method = head_.method;
  request_.target = parse_target(head_.target);
  request_.headers = std::move(head_.headers);
  request_.content_length = head_.content_length;
  request_.has_body = !body_->is_complete();
  request_.read_body = [this](const Request::Sink& sink) { return body_->read(sink); };
  request_.client_has_left = [this] { return connection_.peer_disconnected(); };
  if (request_.headers.contains("Content-Encoding"))
    throw Problem(415, "unsupported_media_type",
                  "the request has Content-Encoding: expected a body without it");
  return request_;
}

std::string Exchange::read_head(size_t max_bytes) {
  std::string text;
  for (size_t line_begin = 0;; line_begin = text.size()) {
    if (!connection_.read_line(text, max_bytes)) {
      if (connection_.error_state() == Connection::ErrorState::kTooSlow)
        throw Problem(408, "timeout", "the request was sent too slowly");
      throw Problem(431, "headers_too_large",
                    "the header fields are too large: expected at most " +
                        std::to_string(max_bytes) + " bytes");
    }
    if (std::string_view(text).substr(line_begin) != "\r\n") continue;
    if (line_begin > 0) return text;
    text.clear();  // empty lines before a request are ignored
  }
}

bool Exchange::answer(Response response, bool last) {
  const bool keep_alive = !last && head_.keep_alive && body_ && body_->is_complete();
  std::string text =
      "HTTP/1.1 " + std::to_string(response.status) + " " + status_title(response.status) + "\r\n";
  const auto add = [&](const std::string& name, const std::string& value) {
    text += name + ": " + value + "\r\n";
  };
  for (const auto& [name, value] : response.headers) add(name, value);
  add("X-Request-Id", request_.id);
  add("Date", http_date());
  add("X-Content-Type-Options", "nosniff");
  add("Referrer-Policy", "no-referrer");
  add("Cross-Origin-Resource-Policy", "same-origin");
  if (!response.headers.contains("Content-Security-Policy"))
    add("Content-Security-Policy", "default-src 'none'; frame-ancestors 'none'");
  if (!keep_alive) add("Connection", "close");
  if (response.next_event) {
    if (!head_.is_http_1_0) add("Transfer-Encoding", "chunked");
  } else if (has_content(response)) {
    uint64_t size = response.body.size();
    for (const FilePiece& piece : response.pieces) size += piece.text.size() + piece.range.size();
    add("Content-Length", std::to_string(size));
  }
  text += "\r\n";
  const bool sends_content = head_.method != "HEAD" && has_content(response);
  if (sends_content) text += response.body;
  if (!connection_.write(text)) return false;
  if (sends_content && response.file && !send_pieces(*response.file, response.pieces)) return false;
  if (sends_content && response.next_event && !send_events(response.next_event)) return false;
  return keep_alive;
}

bool Exchange::send_pieces(ReadableFile& file, const std::vector<FilePiece>& pieces) {
  // A large buffer per answer is safe, because the API limits each client's concurrent answers of
  // this kind.
  connection_.allow_large_send_buffer();
  std::string buffer;
  for (const FilePiece& piece : pieces) {
    if (!connection_.write(piece.text)) return false;
    for (uint64_t at = piece.range.begin; at < piece.range.end; at += buffer.size()) {
      buffer.resize(std::min<uint64_t>(kReadBytes, piece.range.end - at));
      try {
        file.read_at(at, std::as_writable_bytes(std::span(buffer)));
      } catch (const Error&) {
        return false;  // the status is already sent, so the only option is to abort the answer
      }
      if (!connection_.write(buffer)) return false;
    }
  }
  return true;
}

bool Exchange::send_events(const EventSource& next) {
  while (const auto text = next()) {
    if (text->empty()) {
      if (connection_.peer_disconnected()) return false;
    } else if (!connection_.write(head_.is_http_1_0 ? *text
                                                    : chunk_line(text->size()) + *text + "\r\n")) {
      return false;
    }
  }
  return head_.is_http_1_0 || connection_.write("0\r\n\r\n");
}

}  // namespace voxdag::server
