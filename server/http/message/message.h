// A request and its answer as handlers see them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/file_system.h"
#include "server/http/message/byte_range.h"
#include "server/http/message/headers.h"
#include "server/http/message/target.h"

namespace voxdag::server {

// How the reading of a body ended: complete, stopped by the sink, broken or too slow.
enum class BodyEnd { kComplete, kStopped, kBroken, kTooSlow };

struct Request {
  std::string method;
  Target target;
  HeaderMap headers;
  std::string peer;    // the client's address
  double begin_s = 0;  // wall_seconds() when the head was read
  std::string id;      // X-Request-Id of the answer, also in the log
  std::string caller;  // name of the caller's token, once it is known
  std::optional<uint64_t> content_length;
  bool has_body = false;  // true for a Content-Length above 0, or a chunked body

  // Passes the body to `sink` in pieces until the body ends or `sink` returns false. Call it at
  // most once. If the body is not read to its end, the connection is closed after the answer.
  using Sink = std::function<bool(std::string_view piece)>;
  std::function<BodyEnd(const Sink& sink)> read_body;
  // Like read_body, for a JSON body, which the handler keeps in memory. The complete body must
  // arrive within grace_s, however fast its bytes follow each other.
  std::function<BodyEnd(const Sink& sink)> read_short_body;

  // Returns true if the client has closed the connection. Handlers that take long call this
  // function often, and stop when it returns true.
  std::function<bool()> client_has_left;

  std::string header(std::string_view name) const { return header_value(headers, name); }
};

// A piece of an answer: a text, followed by a range of a file. The range may be empty.
struct FilePiece {
  std::string text;
  ByteRange range;
};

// The source of an event stream. A call returns the next bytes to send, "" if there are none yet,
// or nullopt at the end of the stream. A call takes at most about a second.
using EventSource = std::function<std::optional<std::string>()>;

struct Response {
  int status = 200;
  HeaderMap headers;
  // At most one of body, static_body, file and next_event is set.
  std::string body;
  std::string_view static_body;  // like `body`, but part of a text that outlives the server
  std::shared_ptr<ReadableFile> file;
  std::vector<FilePiece> pieces;  // parts of `file` to send
  EventSource next_event;
  bool is_stream = false;  // the answer to HEAD for a stream, which has no next_event
  // A permit of a ConcurrencyLimiter; null if none is needed. It is released when the answer is
  // sent.
  std::shared_ptr<void> permit;
  // A permit to build the answer in memory. It is released as soon as the server has reserved the
  // memory of the answer.
  std::shared_ptr<void> build_permit;
};

inline Response make_response(int status, const char* content_type, const char* cache_control,
                              std::string body = "") {
  Response response;
  response.status = status;
  response.headers = {{"Content-Type", content_type}, {"Cache-Control", cache_control}};
  response.body = std::move(body);
  return response;
}

}  // namespace voxdag::server
