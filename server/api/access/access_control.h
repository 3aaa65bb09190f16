// Who comes in: the Host and Origin of a request, its rate, its token. Thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/api/access/rate_limiter.h"
#include "server/api/access/tokens.h"
#include "server/config.h"
#include "server/http/message.h"

namespace voxdag::server {

class AccessControl {
 public:
  // Reads the token file, if there is one.
  AccessControl(const ServerConfig& config, FileSystem& files);

  // Throws Problem unless the request may do what takes `needed`. Says who it is.
  Caller admit(const Request& request, Role needed);

 private:
  void check_site(const Request& request) const;
  Caller identify(const Request& request);

  std::optional<Tokens> tokens_;
  std::vector<std::string> hosts_;
  RateLimiter requests_;
  RateLimiter wrong_tokens_;
};

}  // namespace voxdag::server
