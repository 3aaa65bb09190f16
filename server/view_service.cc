#include "server/view_service.h"

#include <exception>
#include <thread>

#include "core/base/text/printable.h"
#include "server/api/answers/public_problem.h"
#include "server/api/routes/routes.h"
#include "server/api/routes/tile_routes.h"

namespace voxdag::server {
namespace {

constexpr double kDrainS = 1;
// Maximum number of open files: enough for the old and the new file while the file is being
// replaced.
constexpr size_t kMaxOpen = 2;
constexpr size_t kMaxConcurrentTiles = 64;
// Origins whose pages may show the viewer in a frame: all pages that this machine serves, such as
// notebooks. The service of `voxdag view` only shows a file. So a page with such a frame cannot
// trick the user into changing anything.
constexpr const char* kEmbedders =
    "http://localhost:* https://localhost:* http://127.0.0.1:* https://127.0.0.1:*";

std::string file_name_of(const std::string& path) { return path.substr(path.rfind('/') + 1); }

}  // namespace

ViewService::ViewService(const std::string& path, int port, FileSystem& files, Log log)
    : path_(path),
      log_([log = std::move(log)](const LogEntry& entry) { log(printable_entry(entry)); }),
      open_sources_(files, kMaxOpen),
      tiles_(kMaxConcurrentTiles, kMaxConcurrentTiles),
      access_(ServerConfig{}, files),
      http_(checked_options(port), [this](Request& request) { return answer(request); }) {
  add_tile_routes(
      router_,
      {.base = "/api/v1/view",
       .id = "",
       .subject = "The file: ",
       .manifest_schema = "TileManifest",
       .packing = Packing::kNone,
       .file_name = file_name_of(path),
       .audience = &kCommandLineUsers},
      [this](const Call&) {
        auto permit = tiles_.acquire("");
        if (!permit) throw busy("too many concurrent requests for tiles: " + tiles_.limits(), 1);
        return TileAccess{open_sources_.open(path_), std::move(permit)};
      },
      stopping_);
  add_asset_routes(router_, "viewer.html", kEmbedders);
  add_document_route(router_);
}

// Opens the file first, so that no port is open if the file is refused.
HttpOptions ViewService::checked_options(int port) {
  open_sources_.open(path_);
  HttpOptions options;
  options.port = port;
  return options;
}

std::string ViewService::url() const {
  return "http://127.0.0.1:" + std::to_string(http_.port()) + "/";
}

void ViewService::run() {
  // Computes the cameras in advance, while the browser starts. If this fails, the later request for
  // the cameras also fails.
  const std::jthread cameras([this, file = open_sources_.open(path_)] {
    try {
      file->manifest(stopping_);
    } catch (const std::exception&) {
    }
  });
  http_.run(kDrainS);
}

Response ViewService::answer(Request& request) {
  try {
    return router_.route(request, access_);
  } catch (const std::exception& error) {
    const Problem problem = public_problem(error);
    if (problem.detail != error.what())  // clients do not receive this text
      log_(request.method + " failed: " + error.what());
    if (!problem.log_text.empty()) log_(request.method + " failed: " + problem.log_text);
    return problem_response(problem);
  }
}

}  // namespace voxdag::server
