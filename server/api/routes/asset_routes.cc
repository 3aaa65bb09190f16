// The embedded files.
#include "server/api/routes/router.h"
#include "server/web/assets.h"

namespace voxdag::server {
namespace {

constexpr const char* kPagePolicy =
    "default-src 'self'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

Response get_asset(Call& call, const Asset& asset) {
  Response response;
  response.headers.emplace("ETag", asset.etag);
  response.headers.emplace("Cache-Control", "no-cache");
  response.headers.emplace("Content-Security-Policy", kPagePolicy);
  if (call.request.header("If-None-Match") == asset.etag) {
    response.status = 304;
    return response;
  }
  response.headers.emplace("Content-Type", asset.type);
  response.body = asset.contents;
  return response;
}

}  // namespace

void add_asset_routes(Router& router, const std::string& start_page) {
  for (const Asset& asset : embedded_assets()) {
    const auto get = [asset](Call& call) { return get_asset(call, asset); };
    router.add("GET", '/' + asset.name, Role::kNone, get, kAnyQuery);
    if (asset.name == start_page) router.add("GET", "/", Role::kNone, get, kAnyQuery);
  }
}

}  // namespace voxdag::server
