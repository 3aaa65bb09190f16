#include "server/http/message/request_head.h"

#include <algorithm>
#include <charconv>

#include "scene/messages.h"
#include "server/http/message/problem.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxMethodChars = 32;
constexpr size_t kMaxTargetBytes = 8192;
constexpr size_t kMaxFields = 100;

// Returns the text up to the next CRLF. Removes the text and the CRLF from `rest`.
std::string_view take_line(std::string_view& rest) {
  const size_t end = rest.find("\r\n");
  if (end == std::string_view::npos)
    throw bad_request("the request head has a line without CRLF at its end: expected CRLF");
  const std::string_view line = rest.substr(0, end);
  rest.remove_prefix(end + 2);
  return line;
}

bool is_token(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
  });
}

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

void parse_request_line(std::string_view line, RequestHead& head) {
  const size_t first = line.find(' ');
  const size_t last = line.rfind(' ');
  const auto malformed = [&] {
    return bad_request("the request line '" + printable(line) +
                       "': expected METHOD TARGET HTTP/1.1");
  };
  if (first == std::string_view::npos || first == last) throw malformed();
  head.method = line.substr(0, first);
  head.target = line.substr(first + 1, last - first - 1);
  const std::string_view version = line.substr(last + 1);
  head.is_http_1_0 = version == "HTTP/1.0";
  if ((version != "HTTP/1.1" && !head.is_http_1_0) || !is_token(head.method) ||
      head.method.size() > kMaxMethodChars || head.target.empty() ||
      head.target.find(' ') != std::string::npos || std::ranges::any_of(head.target, is_control))
    throw malformed();
  if (head.target.size() > kMaxTargetBytes)
    throw bad_request("the request target has " + std::to_string(head.target.size()) +
                      " bytes: expected at most " + std::to_string(kMaxTargetBytes));
}

void parse_field(std::string_view line, HeaderMap& headers) {
  const size_t colon = line.find(':');
  if (colon == std::string_view::npos || !is_token(line.substr(0, colon)))
    throw bad_request("the header line '" + printable(line) +
                      "': expected NAME: VALUE, each field on one line");
  const std::string_view value = trimmed(line.substr(colon + 1));
  if (std::ranges::any_of(value, [](char c) { return is_control(c) && c != '\t'; }))
    throw bad_request("the header field " + std::string(line.substr(0, colon)) +
                      " has a control character: expected none but tabs");
  if (headers.size() == kMaxFields)
    throw Problem(
        431, "headers_too_large",
        "the request has too many header fields: expected at most " + std::to_string(kMaxFields));
  headers.emplace(line.substr(0, colon), value);
}

// Header fields that must occur only once: if a field occurred twice, a proxy in front of the
// service might have used the other value.
constexpr const char* kSingleFields[] = {"Authorization", "Content-Encoding", "Content-Range",
                                         "Content-Type",  "Idempotency-Key",  "If-Range",
                                         "Last-Event-ID", "Origin",           "Range"};

// True if a header field with a list as its value, such as Connection, contains `element`.
bool lists(const HeaderMap& headers, std::string_view name, std::string_view element) {
  const auto [begin, end] = headers.equal_range(name);
  return std::any_of(begin, end, [&](const auto& field) {
    for (std::string_view rest = field.second; !rest.empty();) {
      const size_t comma = std::min(rest.find(','), rest.size());
      if (equal_ignoring_case(trimmed(rest.substr(0, comma)), element)) return true;
      rest.remove_prefix(std::min(comma + 1, rest.size()));
    }
    return false;
  });
}

// Determines where the body ends: after Content-Length bytes, or after the last chunk.
void parse_framing(RequestHead& head) {
  const size_t lengths = head.headers.count("Content-Length");
  if (lengths > 0) {
    const std::string text = header_value(head.headers, "Content-Length");
    uint64_t length = 0;
    const auto parsed = std::from_chars(text.data(), text.data() + text.size(), length);
    if (lengths > 1 || parsed.ec != std::errc{} || parsed.ptr != text.data() + text.size())
      throw bad_request("Content-Length '" + printable(text) +
                        (lengths > 1 ? "', given " + std::to_string(lengths) + " times: " : "': ") +
                        "expected one number, once");
    head.content_length = length;
  }
  if (!head.headers.contains("Transfer-Encoding")) return;
  head.chunked = true;
  if (lengths > 0 || head.is_http_1_0)
    throw bad_request("Transfer-Encoding: expected it only in HTTP/1.1, without Content-Length");
  const std::string coding = header_value(head.headers, "Transfer-Encoding");
  if (head.headers.count("Transfer-Encoding") > 1 || !equal_ignoring_case(coding, "chunked"))
    throw bad_request("Transfer-Encoding: '" + printable(coding) +
                      "': expected chunked, given once");
}

}  // namespace

RequestHead parse_request_head(std::string_view text) {
  RequestHead head;
  parse_request_line(take_line(text), head);
  for (std::string_view line = take_line(text); !line.empty(); line = take_line(text))
    parse_field(line, head.headers);
  const size_t hosts = head.headers.count("Host");
  if (hosts > 1 || (hosts == 0 && !head.is_http_1_0))
    throw bad_request("the request has " + std::to_string(hosts) + " Host headers: expected one");
  for (const char* name : kSingleFields)
    if (const size_t count = head.headers.count(name); count > 1)
      throw bad_request("the header field " + std::string(name) + " is given " +
                        std::to_string(count) + " times: expected it once");
  parse_framing(head);
  head.expects_continue = !head.is_http_1_0 && lists(head.headers, "Expect", "100-continue");
  head.keep_alive = !head.is_http_1_0 && !lists(head.headers, "Connection", "close");
  return head;
}

}  // namespace voxdag::server
