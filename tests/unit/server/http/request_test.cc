// Tests the parser of request heads, and complete exchanges over a socket pair.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <string>
#include <thread>

#include "core/base/clock.h"
#include "server/http/exchange.h"
#include "server/http/message/problem.h"

namespace voxdag::server {
namespace {

using ErrorState = Connection::ErrorState;

int status_of(const std::string& head) {
  try {
    parse_request_head(head);
  } catch (const Problem& problem) {
    return problem.status;
  }
  return 200;
}

// Returns the status of a request with these header fields that is otherwise valid.
int status_of_fields(const std::string& fields) {
  return status_of("GET / HTTP/1.1\r\nHost: a\r\n" + fields + "\r\n");
}

TEST(RequestHead, IsParsed) {
  const RequestHead head = parse_request_head(
      "PUT /a?b=c HTTP/1.1\r\nhost:a\r\nX-Empty:\r\nX-Text: \t a:b\xe4 c \t\r\n"
      "Content-Length: 12\r\nExpect: 100-Continue\r\nConnection: x , Close\r\n\r\n");
  EXPECT_EQ(head.method, "PUT");
  EXPECT_EQ(head.target, "/a?b=c");
  EXPECT_EQ(header_value(head.headers, "Host"), "a");
  EXPECT_EQ(header_value(head.headers, "X-Empty"), "");
  EXPECT_EQ(header_value(head.headers, "X-Text"), "a:b\xe4 c");
  EXPECT_EQ(head.content_length, 12u);
  EXPECT_TRUE(head.expects_continue);
  EXPECT_FALSE(head.keep_alive);
  EXPECT_FALSE(head.chunked);
  EXPECT_TRUE(parse_request_head("GET / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: Chunked\r\n\r\n")
                  .chunked);
}

TEST(RequestHead, OldClientsNeedNoHost) {
  const RequestHead head = parse_request_head("GET / HTTP/1.0\r\n\r\n");
  EXPECT_TRUE(head.is_http_1_0);
  EXPECT_FALSE(head.keep_alive);
}

TEST(RequestHead, RejectsMalformedRequestLines) {
  const std::string rest = "\r\nHost: a\r\n\r\n";
  EXPECT_EQ(status_of("GET / HTTP/1.1" + rest), 200);
  for (const std::string line :
       {"", "GET", "GET /", "GET  HTTP/1.1", "GET / ", " / HTTP/1.1", "GET / HTTP/2",
        "GET / HTTP/1.2", "GET / http/1.1", "GET /a b HTTP/1.1", "GET /\x01 HTTP/1.1",
        "GET\t/ HTTP/1.1", "G(T / HTTP/1.1", "GET / HTTP/1.1 ", "GET /\x7f HTTP/1.1",
        "GET /\r HTTP/1.1", "GET /\n HTTP/1.1"}) {
    SCOPED_TRACE(line);
    EXPECT_EQ(status_of(line + rest), 400);
  }
  EXPECT_EQ(status_of(std::string(33, 'A') + " / HTTP/1.1" + rest), 400);
  EXPECT_EQ(status_of("GET /" + std::string(8192, 'a') + " HTTP/1.1" + rest), 400);
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\nHost: a\r\n"), 400) << "no end";
  EXPECT_EQ(status_of("GET / HTTP/1.1\nHost: a\n\n"), 400) << "lines end with LF";
}

TEST(RequestHead, RejectsMalformedFields) {
  EXPECT_EQ(status_of_fields(""), 200);
  for (const std::string field :
       {"x", ":x", " x: y", "a: b\r\n c", "a\t: b", "a b: c", "a: b\nc: d", "a: b\rc: d", "a: \x01",
        "a: \x7f", "(a): b", "\xe4: b", "a: b\n"}) {
    SCOPED_TRACE(field);
    EXPECT_EQ(status_of_fields(field + "\r\n"), 400);
  }
  EXPECT_EQ(status_of_fields(std::string("a: \0b\r\n", 7)), 400);
}

// Rejects headers from which a proxy and the service could derive different lengths of the body.
TEST(RequestHead, RejectsAmbiguousFraming) {
  for (const std::string fields :
       {"Content-Length: 1\r\nContent-Length: 1\r\n", "Content-Length: 1, 1\r\n",
        "Content-Length: +1\r\n", "Content-Length: -1\r\n", "Content-Length: 0x1\r\n",
        "Content-Length:\r\n", "Content-Length: 18446744073709551616\r\n",
        "Content-Length: 1\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: gzip, chunked\r\n", "Transfer-Encoding: identity\r\n",
        "Transfer-Encoding:\r\n", "Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n"}) {
    SCOPED_TRACE(fields);
    EXPECT_EQ(status_of_fields(fields), 400);
  }
  EXPECT_EQ(status_of("GET / HTTP/1.0\r\nTransfer-Encoding: chunked\r\n\r\n"), 400);
}

TEST(HostileRequests, ABlankBeforeTheColonIsRejected) {
  EXPECT_EQ(status_of_fields("Transfer-Encoding : chunked\r\n"), 400);
  EXPECT_EQ(status_of_fields("Content-Length : 5\r\n"), 400);
}

TEST(HostileRequests, OneHostIsExpected) {
  EXPECT_EQ(status_of_fields("Host: b\r\n"), 400);
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET / HTTP/1.0\r\nHost: a\r\nHost: a\r\n\r\n"), 400);
}

TEST(HostileRequests, FieldsAreBounded) {
  std::string fields;
  for (int i = 0; i < 99; ++i) fields += "x: y\r\n";
  EXPECT_EQ(status_of_fields(fields), 200);
  EXPECT_EQ(status_of_fields(fields + "x: y\r\n"), 431);
}

// Connects the server's Connection with a simulated client that has sent `bytes`. The client has
// then closed its sending side, unless `waits` is true.
class Client {
 public:
  explicit Client(const std::string& bytes, bool waits = false) {
    limits_.grace_s = limits_.header_timeout_s = limits_.idle_timeout_s = 0.1;
    EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends_), 0);
    EXPECT_EQ(send(ends_[1], bytes.data(), bytes.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(bytes.size()));
    if (!waits) shutdown(ends_[1], SHUT_WR);
    EXPECT_TRUE(table_.admit(ends_[0], "127.0.0.1", place_));
    connection_.emplace(ends_[0], limits_, TlsSession{}, table_, place_);
  }
  ~Client() {
    close(ends_[0]);
    close(ends_[1]);
  }

  Connection& connection() { return *connection_; }
  // Reads the head of the next request. Returns 200, or the status of the error; 0 if the
  // connection has ended.
  int next_request() {
    body_.clear();
    if (!connection_->wait_for_request()) return 0;
    exchange_.emplace(*connection_, "127.0.0.1");
    try {
      request_ = &exchange_->read_request(limits_.max_header_bytes);
    } catch (const Problem& problem) {
      return problem.status;
    }
    return 200;
  }
  Request& request() { return *request_; }
  BodyEnd read_body(size_t max_bytes = SIZE_MAX) {
    return request_->read_body([&](std::string_view piece) {
      body_ += piece;
      return body_.size() <= max_bytes;
    });
  }
  const std::string& body() const { return body_; }
  void send_more(const std::string& bytes) {
    send(ends_[1], bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  bool answer(Response response) {
    return exchange_->answer(std::move(response), false, [](int) {});
  }
  // Returns all bytes that the server has sent to the client since the last call.
  std::string received() {
    std::string text(1 << 16, '\0');
    const ssize_t got = recv(ends_[1], text.data(), text.size(), 0);
    text.resize(got > 0 ? static_cast<size_t>(got) : 0);
    return text;
  }

 private:
  HttpLimits limits_;
  int ends_[2];
  ConnectionTable table_{limits_};
  ConnectionTable::Place place_;
  std::optional<Connection> connection_;
  std::optional<Exchange> exchange_;
  Request* request_ = nullptr;
  std::string body_;
};

std::string put(const std::string& fields, const std::string& body) {
  return "PUT /x HTTP/1.1\r\nHost: a\r\n" + fields + "\r\n" + body;
}
std::string chunked(const std::string& body) { return put("Transfer-Encoding: chunked\r\n", body); }

// A connection serves several requests one after the other, with bodies of known length and with
// chunked bodies.
TEST(Exchange, ReadsOneRequestAfterTheOther) {
  Client client("\r\n\r\n" + put("Content-Length: 3\r\n", "abc") +
                chunked("3;x=y\r\nabc\r\n0A \r\n0123456789\r\n0\r\nTrailer: x\r\n\r\n") +
                put("", "") + chunked("0\r\n\r\n"));
  for (const std::string body : {"abc", "abc0123456789", "", ""}) {
    SCOPED_TRACE(body);
    ASSERT_EQ(client.next_request(), 200);
    EXPECT_EQ(client.read_body(), BodyEnd::kComplete);
    EXPECT_EQ(client.body(), body);
    EXPECT_TRUE(client.answer(make_response(200, "text/plain", "no-store", "x")));
  }
  EXPECT_EQ(client.next_request(), 0);
}

// If a handler does not read a body to its end, the connection is closed, because the rest would be
// taken for the next request.
TEST(Exchange, ClosesAfterAnUnreadBody) {
  Client client(put("Content-Length: 3\r\n", "abc"));
  ASSERT_EQ(client.next_request(), 200);
  EXPECT_EQ(client.read_body(1), BodyEnd::kStopped);
  EXPECT_FALSE(client.answer(make_response(413, "text/plain", "no-store")));
  EXPECT_NE(client.received().find("Connection: close\r\n"), std::string::npos);
}

TEST(Exchange, AsksForABodyOnlyWhenItIsRead) {
  Client client(put("Content-Length: 3\r\nExpect: 100-continue\r\n", ""), true);
  ASSERT_EQ(client.next_request(), 200);
  EXPECT_EQ(client.received(), "");
  EXPECT_EQ(client.read_body(), BodyEnd::kTooSlow);
  EXPECT_EQ(client.received(), "HTTP/1.1 100 Continue\r\n\r\n");
}

TEST(Exchange, RejectsMalformedChunks) {
  for (const std::string body :
       {"x\r\n", "\r\n", "-1\r\n", "0x3\r\nabc\r\n0\r\n\r\n", " 3\r\nabc\r\n0\r\n\r\n",
        "3\nabc\r\n0\r\n\r\n", "3\r\nabcd\r\n0\r\n\r\n", "3\r\nabc0\r\n\r\n",
        "3 x\r\nabc\r\n0\r\n\r\n", "3;\rx\r\nabc\r\n0\r\n\r\n", "10000000000000000\r\n",
        "3\r\nabc\r\n0\r\n", "3\r\nab"}) {
    SCOPED_TRACE(body);
    Client client(chunked(body));
    ASSERT_EQ(client.next_request(), 200);
    EXPECT_EQ(client.read_body(), BodyEnd::kBroken);
    EXPECT_FALSE(client.answer(make_response(400, "text/plain", "no-store")));
  }
}

// The lines before chunks and the trailer fields have a total limit of bytes. The chunks themselves
// can be small and many.
TEST(HostileRequests, LinesOfChunksAreBounded) {
  const std::string endless(32768, '0');
  std::string extensions, trailers;
  for (int i = 0; i < 20; ++i) {
    extensions += "1;" + std::string(1000, 'x') + "\r\na\r\n";
    trailers += "X: " + std::string(1000, 'x') + "\r\n";
  }
  std::string short_trailers;
  for (int i = 0; i < 4000; ++i) short_trailers += "a:b\r\n";
  for (const std::string& body :
       {endless, "4;" + endless, "1\r\na" + endless, "0\r\nX: " + endless, extensions + "0\r\n\r\n",
        "0\r\n" + trailers + "\r\n", "2\r\n{}\r\n0\r\n" + short_trailers + "\r\n",
        "0;" + std::string(4000, 'x') + "\r\n" + trailers + "\r\n"}) {
    SCOPED_TRACE(body.substr(0, 20));
    Client client(chunked(body));
    ASSERT_EQ(client.next_request(), 200);
    EXPECT_EQ(client.read_body(), BodyEnd::kBroken);
    EXPECT_LE(client.body().size(), 20u);
  }
  std::string small;
  for (int i = 0; i < 10000; ++i) small += "1\r\na\r\n";
  Client client(chunked(small + "0\r\n\r\n"));
  ASSERT_EQ(client.next_request(), 200);
  EXPECT_EQ(client.read_body(), BodyEnd::kComplete) << "small chunks are allowed";
  EXPECT_EQ(client.body().size(), 10000u);
}

// Empty lines before a request are ignored until they exceed the limit of bytes for a header.
TEST(HostileRequests, EmptyLinesAreBounded) {
  std::string lines;
  for (int i = 0; i < 20000; ++i) lines += "\r\n";
  Client client(lines + "GET / HTTP/1.1\r\nHost: a\r\n\r\n");
  EXPECT_EQ(client.next_request(), 431);
}

// The time limit of a short body ends with the body. The following answer and the next request are
// not affected.
TEST(HostileRequests, TheDeadlineOfABodyEndsWithIt) {
  Client client(put("Content-Length: 1\r\n", "x"), true);
  ASSERT_EQ(client.next_request(), 200);
  const auto ignore = [](std::string_view) { return true; };
  EXPECT_EQ(client.request().read_short_body(ignore), BodyEnd::kComplete);
  std::this_thread::sleep_for(std::chrono::milliseconds(150));
  EXPECT_TRUE(client.answer(make_response(200, "text/plain", "no-store", "x")));
  client.send_more(put("Content-Length: 1\r\n", "y"));
  ASSERT_EQ(client.next_request(), 200);
  EXPECT_EQ(client.request().read_short_body(ignore), BodyEnd::kComplete);
}

// A short body must be complete within a time limit, even if its bytes arrive faster than the
// minimum rate.
TEST(HostileRequests, ShortBodiesHaveADeadline) {
  Client client(put("Content-Length: 100000000\r\n", ""), true);
  ASSERT_EQ(client.next_request(), 200);
  std::jthread sender([&](const std::stop_token& end) {
    while (!end.stop_requested()) {
      client.send_more(std::string(200, 'x'));
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  const double start = wall_seconds();
  const BodyEnd end = client.request().read_short_body([](std::string_view) { return true; });
  EXPECT_EQ(end, BodyEnd::kTooSlow);
  EXPECT_LT(wall_seconds() - start, 20);
}

TEST(HostileRequests, HeadersAreBounded) {
  for (const std::string& bytes :
       {"GET /" + std::string(40000, 'x'),
        "GET / HTTP/1.1\r\nX: " + std::string(40000, 'x') + "\r\n\r\n"}) {
    Client client(bytes);
    EXPECT_EQ(client.next_request(), 431);
  }
}

TEST(Exchange, TimesOut) {
  Client header("GET / HTTP/1.1\r\n", true);
  EXPECT_EQ(header.next_request(), 408);
  Client body(put("Content-Length: 3\r\n", "ab"), true);
  ASSERT_EQ(body.next_request(), 200);
  EXPECT_EQ(body.read_body(), BodyEnd::kTooSlow);
  EXPECT_EQ(body.connection().error_state(), ErrorState::kTooSlow);
  Client idle("", true);
  EXPECT_EQ(idle.next_request(), 0);
}

// If a client falls silent within a body, the connection ends after the usual time, even if the
// client sent many bytes at first.
TEST(HostileRequests, PastBytesDoNotExcuseSilence) {
  Client client(put("Content-Length: 1000000\r\n", std::string(100000, 'x')), true);
  ASSERT_EQ(client.next_request(), 200);
  const double start = wall_seconds();
  EXPECT_EQ(client.read_body(), BodyEnd::kTooSlow);
  EXPECT_EQ(client.body().size(), 100000u);
  EXPECT_LT(wall_seconds() - start, 20);
}

// An answer whose status allows no content has no Content-Length. The answer to HEAD has the length
// of the content that it omits.
TEST(Exchange, WritesAnswers) {
  const auto answer_to = [](const std::string& request, Response response) {
    Client client(request);
    EXPECT_EQ(client.next_request(), 200);
    client.answer(std::move(response));
    return client.received();
  };
  const std::string get = "GET / HTTP/1.1\r\nHost: a\r\n\r\n";
  const std::string whole = answer_to(get, make_response(200, "text/plain", "no-store", "hello"));
  EXPECT_TRUE(whole.starts_with("HTTP/1.1 200 OK\r\n")) << whole;
  EXPECT_NE(whole.find("\r\nContent-Length: 5\r\n"), std::string::npos) << whole;
  EXPECT_TRUE(whole.ends_with("\r\n\r\nhello")) << whole;
  const std::string head = answer_to("HEAD / HTTP/1.1\r\nHost: a\r\n\r\n",
                                     make_response(200, "text/plain", "no-store", "hello"));
  EXPECT_NE(head.find("\r\nContent-Length: 5\r\n"), std::string::npos) << head;
  EXPECT_TRUE(head.ends_with("\r\n\r\n")) << head;
  Response none;
  none.status = 204;
  EXPECT_EQ(answer_to(get, none).find("Content-Length"), std::string::npos);

  const auto events = [] {
    Response response = make_response(200, "text/event-stream", "no-store");
    response.next_event = [count = 0]() mutable -> std::optional<std::string> {
      return ++count <= 2 ? std::optional("event") : std::nullopt;
    };
    return response;
  };
  const std::string stream = answer_to(get, events());
  EXPECT_NE(stream.find("\r\nTransfer-Encoding: chunked\r\n"), std::string::npos) << stream;
  EXPECT_TRUE(stream.ends_with("\r\n\r\n5\r\nevent\r\n5\r\nevent\r\n0\r\n\r\n")) << stream;
  const std::string old = answer_to("GET / HTTP/1.0\r\n\r\n", events());
  EXPECT_EQ(old.find("Transfer-Encoding"), std::string::npos) << old;
  EXPECT_TRUE(old.ends_with("\r\n\r\neventevent")) << old;
}

}  // namespace
}  // namespace voxdag::server
