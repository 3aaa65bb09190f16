// One request and its answer on a connection. Used by one thread.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "server/http/body_reader.h"
#include "server/http/connection/connection.h"
#include "server/http/message/message.h"
#include "server/http/message/request_head.h"

namespace voxdag::server {

class Exchange {
 public:
  Exchange(Connection& connection, const std::string& address);

  // Reads the head of the request. Request::read_body reads the body. Throws Problem if the head is
  // malformed, too large or too slow, or has a Content-Encoding.
  Request& read_request(size_t max_header_bytes);
  // Sends the answer, or the problem 503 if there is no memory for it. `last` is true if the server
  // accepts no further request on the connection. Calls `on_status` with the status of the answer
  // before its first byte is sent. Returns true if another request can follow on the connection.
  bool answer(Response response, bool last, const std::function<void(int status)>& on_status);

 private:
  std::string read_head(size_t max_bytes);
  std::string answer_head(const Response& response, bool keep_alive) const;
  bool send(const Response& response, const std::string& head);
  bool send_event(const std::string& text);
  bool send_pieces(const Response& response);
  bool send_events(const EventSource& next);

  Connection& connection_;
  RequestHead head_;
  std::optional<BodyReader> body_;  // set after the head is read
  Request request_;
};

}  // namespace voxdag::server
