// One request and its answer: the translation between httplib's messages and ours. Used by one
// thread.
//
// httplib does not see the request's range, encoding and path: Debian's 0.11.4 accepts ranges
// beyond the end and compresses whenever a client asks for it.
#pragma once

#include <string>

#include "server/http/connection/connection.h"
#include "server/http/message.h"
#include "server/http/problem.h"

namespace voxdag::server {

class Exchange {
 public:
  Exchange(Connection& connection, const std::string& address);

  // Called when the header has been read: copies it, and removes from `raw` the fields that httplib
  // would act on.
  void begin(httplib::Request& raw);
  // Throws Problem if the end of the body is ambiguous or the target is not a path. `reader` is
  // null where httplib expects no body.
  void check(const httplib::ContentReader* reader);
  Request& request() { return request_; }
  // Writes the answer to `out`; `last` closes the connection after it.
  void answer(Response response, httplib::Response& out, bool last);
  // Replaces an error that httplib itself answered with a problem.
  void answer_error(httplib::Response& out);
  // Whether the request was read to its end, so that another one may follow.
  bool is_complete() const;
  // Answers a header that was too slow or too large; httplib closes such connections silently.
  void send_error();

 private:
  void add_standard_headers(httplib::Response& out) const;

  Connection& connection_;
  Request request_;
  std::string target_;
  std::string framing_error_;  // why the end of the body is ambiguous; "" if it is not
  bool begun_ = false;
  bool answered_ = false;
  bool chunked_ = false;
  bool read_to_end_ = false;  // the chunked body
};

}  // namespace voxdag::server
