// One request and its answer on their way through httplib.
//
// httplib's own treatment of ranges, compression and paths is taken out of its hands: Debian's
// 0.11.4 lets ranges through that lie outside, and would compress for anybody who asks.
#pragma once

#include <string>

#include "server/api/problem.h"
#include "server/http/connection/connection.h"
#include "server/http/message.h"

namespace voxdag::server {

Response problem_response(const Problem& problem);

class Exchange {
 public:
  Exchange(Connection& connection, const std::string& address);

  // The header has been read: remembers what it says, and takes out of it what httplib would act
  // on.
  void begin(httplib::Request& raw);
  // Throws Problem if the request cannot be told apart from the next, or its target is no path.
  // `reader` is null where httplib expects no body.
  void check(const httplib::ContentReader* reader);
  Request& request() { return request_; }
  void put(Response response, httplib::Response& out, bool last);
  // The problem behind a status that httplib chose itself.
  void refuse(httplib::Response& out);
  // The request was read to its end and answered: another may follow.
  bool is_whole() const;
  // Answers a header that was too slow or too large, which httplib leaves unanswered.
  void say_why_not();

 private:
  void add_standard_headers(httplib::Response& out) const;

  Connection& connection_;
  Request request_;
  std::string target_;
  std::string bad_framing_;  // what is wrong with it; "" if nothing
  bool begun_ = false;
  bool answered_ = false;
  bool chunked_ = false;
  bool read_to_end_ = false;  // of a chunked body
};

}  // namespace voxdag::server
