// Reads the body of a request from its connection. Memory and the number of bytes outside the
// content are bounded for any client: the reader passes content on as it arrives, and limits the
// lines between and after chunks. Used by one thread.
#pragma once

#include "server/http/connection/connection.h"
#include "server/http/message/message.h"
#include "server/http/message/request_head.h"

namespace voxdag::server {

class BodyReader {
 public:
  BodyReader(Connection& connection, const RequestHead& head);

  // Reads the body as Request::read_body does. Returns BodyEnd::kBroken for a malformed chunk, or
  // for too many bytes outside the content.
  BodyEnd read(const Request::Sink& sink);
  // True if the body was read to its end, so that another request can follow.
  bool is_complete() const { return complete_; }

 private:
  BodyEnd read_chunks(const Request::Sink& sink);
  BodyEnd pass(uint64_t bytes, const Request::Sink& sink);
  // Reads a line without its CRLF. Returns false if it is too long or the connection fails.
  bool read_line(std::string& line);
  // Counts bytes outside the content. Returns false above the limit for one body.
  bool count_extra(size_t bytes);
  BodyEnd failure() const;

  Connection& connection_;
  const uint64_t length_;
  const bool chunked_;
  const bool expects_continue_;
  bool complete_;
  size_t extra_bytes_ = 0;  // bytes so far that count_extra() has counted
};

}  // namespace voxdag::server
