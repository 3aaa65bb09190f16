// Access control. Limits the rate of every client's requests and checks their tokens. Without a
// token file, checks the Host and Origin of requests instead. Thread-safe.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/api/access/cross_origin.h"
#include "server/api/access/rate_limiter.h"
#include "server/api/access/tokens.h"
#include "server/config/config.h"
#include "server/http/message/message.h"

namespace voxdag::server {

class AccessControl {
 public:
  // Reads the token file if one is configured. Throws as Tokens::read does.
  AccessControl(const ServerConfig& config, FileSystem& files);

  // Returns the caller who sends the request. Sets request.caller as soon as the caller is known.
  // Throws Problem: 401 for a missing or unknown token, 403 for a caller whose role is below
  // `needed` or for a wrong Host or Origin, and 429 above a rate limit.
  Caller admit(Request& request, Role needed);

  // Returns the rules for requests from web pages of other origins.
  const CrossOrigin& cross_origin() const { return cross_origin_; }

 private:
  void check_site(const Request& request) const;
  Caller identify(const Request& request);

  std::optional<Tokens> tokens_;
  std::vector<std::string> hosts_;
  const CrossOrigin cross_origin_;
  RateLimiter requests_;
  RateLimiter wrong_tokens_;
};

}  // namespace voxdag::server
