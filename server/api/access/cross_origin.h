// Cross-origin requests (CORS): lets web pages of the origins in the setting `cors_origins` use the
// API. Immutable.
#pragma once

#include <string>
#include <vector>

#include "server/http/message/message.h"

namespace voxdag::server {

class CrossOrigin {
 public:
  explicit CrossOrigin(std::vector<std::string> origins) : origins_(std::move(origins)) {}

  // True if the request is from a page of a listed origin.
  bool allows(const Request& request) const;
  // True if the request is a browser's question whether such a page may send another request.
  bool is_preflight(const Request& request) const;
  // Returns the answer to a preflight request.
  static Response preflight_response();
  // Adds the headers that let the page read the answer, if allows(request).
  void add_headers(const Request& request, Response& response) const;

 private:
  const std::vector<std::string> origins_;
};

}  // namespace voxdag::server
