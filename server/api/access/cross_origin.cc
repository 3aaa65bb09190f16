#include "server/api/access/cross_origin.h"

#include <algorithm>

namespace voxdag::server {

bool CrossOrigin::allows(const Request& request) const {
  return std::ranges::find(origins_, request.header("Origin")) != origins_.end();
}

bool CrossOrigin::is_preflight(const Request& request) const {
  return request.method == "OPTIONS" && allows(request) &&
         request.headers.contains("Access-Control-Request-Method");
}

Response CrossOrigin::preflight_response() {
  Response response;
  response.status = 204;
  response.headers = {
      {"Access-Control-Allow-Methods", "GET, HEAD, PUT, POST, PATCH, DELETE"},
      {"Access-Control-Allow-Headers",
       "Authorization, Content-Type, Content-Range, Content-Digest, Repr-Digest, Idempotency-Key, "
       "If-Match, If-None-Match, If-Range, Range, Last-Event-ID"},
      {"Access-Control-Max-Age", "600"}};
  return response;
}

void CrossOrigin::add_headers(const Request& request, Response& response) const {
  if (origins_.empty()) return;
  response.headers.emplace("Vary", "Origin");
  if (!allows(request)) return;
  response.headers.emplace("Access-Control-Allow-Origin", request.header("Origin"));
  response.headers.emplace("Access-Control-Expose-Headers",
                           "Content-Range, ETag, Idempotent-Replayed, Location, Repr-Digest, "
                           "Retry-After, Upload-Length, Upload-Offset, X-Request-Id");
}

}  // namespace voxdag::server
