// A request and its answer, as the service's handlers see them; httplib stays in its folder.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/file_system.h"
#include "server/http/byte_range.h"
#include "server/http/headers.h"
#include "server/http/target.h"

namespace voxdag::server {

enum class BodyEnd { kWhole, kStopped, kBroken, kTooSlow };

struct Request {
  std::string method;
  Target target;
  HeaderMap headers;
  std::string peer;    // the client's address
  std::string id;      // of this request, in answer and log
  std::string caller;  // whose token it has, once that is known
  std::optional<uint64_t> content_length;
  bool has_body = false;  // a Content-Length above 0, or chunks of unknown number

  // Hands the body to `sink` piece by piece, until that returns false. Called at most once; an
  // unread body costs the client its connection.
  using Sink = std::function<bool(std::string_view piece)>;
  std::function<BodyEnd(const Sink& sink)> read_body;

  std::string header(std::string_view name) const { return header_value(headers, name); }
};

// The next piece of a file's answer: a text, then a range of the file (which may be empty).
struct FilePiece {
  std::string text;
  ByteRange range;
};

// An endless answer. next() gives what is to be sent, "" for nothing yet, no value for the end; it
// returns within about a second.
using EventText = std::function<std::optional<std::string>()>;

struct Response {
  int status = 200;
  HeaderMap headers;
  // One of the three, or none.
  std::string body;
  std::shared_ptr<ReadableFile> file;
  std::vector<FilePiece> pieces;  // of `file`
  EventText next_event;
  // Held until the answer is sent: a slot of a limit.
  std::shared_ptr<void> slot;
};

}  // namespace voxdag::server
