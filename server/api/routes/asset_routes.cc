// Serves the embedded files and the OpenAPI document.
#include <memory>
#include <mutex>

#include "core/format/checksum.h"
#include "server/api/openapi/document.h"
#include "server/api/routes/routes.h"
#include "server/web/assets.h"

namespace voxdag::server {
namespace {

constexpr const char* kPagePolicy =
    "default-src 'self'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors ";
// Pages of other origins may show only the viewer in a frame, and only if the URL of the frame has
// the query parameter kEmbed.
constexpr const char* kViewerPage = "viewer.html";
constexpr const char* kEmbed = "embed";

// Returns the response with a file. `ancestors` is the value of "frame-ancestors" in its
// Content-Security-Policy: the origins whose pages may show the file in a frame.
Response get_asset(Call& call, const Asset& asset, const std::string& ancestors = "'none'") {
  Response response;
  response.headers.emplace("ETag", asset.etag);
  response.headers.emplace("Cache-Control", "no-cache");
  response.headers.emplace("Content-Security-Policy", kPagePolicy + ancestors);
  if (call.request.header("If-None-Match") == asset.etag) {
    response.status = 304;
    return response;
  }
  response.headers.emplace("Content-Type", asset.type);
  response.static_body = asset.contents;
  return response;
}

// The OpenAPI document. The first request for the document creates it: at that time, all routes
// have been added.
struct Document {
  std::once_flag is_created;
  Asset asset;
};

}  // namespace

void add_asset_routes(Router& router, const std::string& start_page, const std::string& embedders) {
  for (const Asset& asset : embedded_assets()) {
    const auto add = [&](const std::string& path) {
      router.add({.method = "GET", .pattern = path, .role = Role::kNone, .accepts_any_query = true},
                 [&asset, embedders](Call& call) {
                   const bool is_framed = asset.name == kViewerPage && !embedders.empty() &&
                                          call.request.target.query.contains(kEmbed);
                   return get_asset(call, asset, is_framed ? embedders : "'none'");
                 });
    };
    add('/' + asset.name);
    if (asset.name == start_page) add("/");
  }
}

void add_document_route(Router& router) {
  router.add({.method = "GET",
              .pattern = "/openapi.json",
              .role = Role::kNone,
              .id = "openapi",
              .summary = "This document",
              .tag = "service",
              .accepts_any_query = true,
              .answers = {{200, "OpenAPI 3.1", {json_content()}}, {304, "the client has it"}}},
             [&router, document = std::make_shared<Document>()](Call& call) {
               std::call_once(document->is_created, [&] {
                 const std::string text = openapi_document(router);
                 document->asset = {"openapi.json", text, "application/json",
                                    '"' + sha256_hex(text) + '"'};
               });
               return get_asset(call, document->asset);
             });
}

}  // namespace voxdag::server
