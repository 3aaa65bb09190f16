#include "server/http/exchange.h"

#include <algorithm>
#include <cstdio>
#include <ctime>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/io/random_id.h"
#include "server/http/message/problem.h"

namespace voxdag::server {
namespace {

constexpr size_t kReadBytes = 256 << 10;  // bytes of a file per write to the socket
// ConnectionTable::kMaxAnswerBytes limits the memory of larger answers. The number of connections
// limits the memory of smaller answers.
constexpr size_t kSmallAnswerBytes = 16 << 10;

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

uint64_t content_size(const Response& response) {
  uint64_t size = response.body.empty() ? response.static_body.size() : response.body.size();
  for (const FilePiece& piece : response.pieces) size += piece.text.size() + piece.range.size();
  return size;
}

// Returns the memory that the answer needs until it is sent: its body, or the buffer for its file.
size_t memory_of(const Response& response) {
  return response.file ? std::min<uint64_t>(kReadBytes, content_size(response))
                       : response.body.size();
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
  request_.begin_s = wall_seconds();
  request_.method = head_.method;
  request_.target = parse_target(head_.target);
  request_.headers = std::move(head_.headers);
  request_.content_length = head_.content_length;
  request_.has_body = !body_->is_complete();
  request_.read_body = [this](const Request::Sink& sink) { return body_->read(sink); };
  request_.read_short_body = [this](const Request::Sink& sink) {
    connection_.limit_request();
    return body_->read(sink);
  };
  request_.client_has_left = [this] { return connection_.peer_disconnected(); };
  if (request_.headers.contains("Content-Encoding"))
    throw Problem(415, "unsupported_media_type",
                  "the request has Content-Encoding: expected a body without it");
  return request_;
}

std::string Exchange::read_head(size_t max_bytes) {
  std::string text;
  size_t blank_bytes = 0;  // bytes of empty lines before the request, which count against
                           // `max_bytes`
  for (size_t line_begin = 0;; line_begin = text.size()) {
    if (!connection_.read_line(text, max_bytes - blank_bytes)) {
      if (connection_.error_state() == Connection::ErrorState::kTooSlow)
        throw Problem(408, "timeout",
                      "the header of the request was sent too slowly: expected it within "
                      "connections.header_timeout_s of the configuration");
      if (blank_bytes > 0) connection_.close_without_linger();
      throw Problem(431, "headers_too_large",
                    "the header fields are too large: expected at most " +
                        std::to_string(max_bytes) + " bytes");
    }
    if (std::string_view(text).substr(line_begin) != "\r\n") continue;
    if (line_begin > 0) return text;
    blank_bytes += text.size();
    text.clear();
  }
}

bool Exchange::answer(Response response, bool last,
                      const std::function<void(int status)>& on_status) {
  if (response.body.capacity() > kSmallAnswerBytes) response.body.shrink_to_fit();
  const size_t bytes = memory_of(response);
  const bool reserves = bytes > kSmallAnswerBytes;
  if (reserves && !connection_.reserve_answer(bytes))
    response = problem_response(
        busy("too many large answers are being sent: expected the request again later"));
  response.build_permit.reset();
  on_status(response.status);
  const bool keep_alive = !last && head_.keep_alive && body_ && body_->is_complete();
  const bool sent = send(response, answer_head(response, keep_alive));
  response = {};
  if (reserves) connection_.release_answer();
  return sent && keep_alive;
}

std::string Exchange::answer_head(const Response& response, bool keep_alive) const {
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
  if (response.next_event || response.is_stream) {
    if (!head_.is_http_1_0) add("Transfer-Encoding", "chunked");
  } else if (has_content(response)) {
    add("Content-Length", std::to_string(content_size(response)));
  }
  return text + "\r\n";
}

bool Exchange::send(const Response& response, const std::string& head) {
  if (head_.method == "HEAD" || !has_content(response)) return connection_.write(head);
  const std::string_view body = response.body.empty() ? response.static_body : response.body;
  // Sends a small body in the same packet as the head.
  const bool in_one = body.size() <= kSmallAnswerBytes;
  if (!connection_.write(in_one ? head + std::string(body) : head)) return false;
  if (!in_one && !connection_.write(body)) return false;
  if (response.file && !send_pieces(response)) return false;
  return !response.next_event || send_events(response.next_event);
}

bool Exchange::send_pieces(const Response& response) {
  // Answers with a permit may use a large buffer in the kernel, because the number of permits
  // limits the concurrent answers of each client.
  if (response.permit) connection_.allow_large_send_buffer();
  std::string buffer;
  for (const FilePiece& piece : response.pieces) {
    if (!connection_.write(piece.text)) return false;
    for (uint64_t at = piece.range.begin; at < piece.range.end; at += buffer.size()) {
      buffer.resize(std::min<uint64_t>(kReadBytes, piece.range.end - at));
      try {
        response.file->read_at(at, std::as_writable_bytes(std::span(buffer)));
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
    const bool sent = text->empty() ? !connection_.peer_disconnected() : send_event(*text);
    if (!sent) return false;
  }
  return head_.is_http_1_0 || connection_.write("0\r\n\r\n");
}

bool Exchange::send_event(const std::string& text) {
  const bool chunked = !head_.is_http_1_0;
  if (text.size() <= kSmallAnswerBytes)
    return connection_.write(chunked ? chunk_line(text.size()) + text + "\r\n" : text);
  if (!connection_.reserve_answer(text.size())) return false;
  const bool sent = (!chunked || connection_.write(chunk_line(text.size()))) &&
                    connection_.write(text) && (!chunked || connection_.write("\r\n"));
  connection_.release_answer();
  return sent;
}

}  // namespace voxdag::server
