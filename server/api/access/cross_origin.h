// Cross-origin requests (CORS): lets web pages of the origins in the setting `cors_origins` use the
// API. Immutable after construction.
#pragma once

#include <string>
#include <vector>

#include "server/http/message/message.h"

namespace voxdag::server {

class CrossOrigin {
 public:
  explicit CrossOrigin(std::vector<std::string> origins) : origins_(std::move(origins)) {}

  // True if a page of a listed origin has sent the request.
  bool allows(const Request& request) const;
  // True if the request is a preflight request: before a page of a listed origin sends its actual
  // request, the browser asks whether the service allows it.
  bool is_preflight(const Request& request) const;
  // Returns the response to a preflight request. It allows all methods and header fields of the
  // API.
  static Response preflight_response();
  // If allows(request), adds the header fields that let the page read the response. If any origin
  // is listed, always adds "Vary", because responses then depend on the origin.
  void add_headers(const Request& request, Response& response) const;

 private:
  const std::vector<std::string> origins_;
};

}  // namespace voxdag::server
