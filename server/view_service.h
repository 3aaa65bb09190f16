// Shows one finished DAG in a browser on this machine, for `voxdag view`. The service listens only
// on the loopback, reads only this file and writes nothing. If the file is replaced, the service
// shows the new file. Thread-safe.
#pragma once

#include <functional>
#include <string>

#include "server/api/access/access_control.h"
#include "server/api/access/concurrency_limiter.h"
#include "server/api/routing/router.h"
#include "server/base/steps.h"
#include "server/http/http_server.h"
#include "server/tiles/open_tile_sources.h"

namespace voxdag::server {

class ViewService {
 public:
  // Opens the file and listens; port 0 means any free port. `log` receives failures. Throws Error.
  ViewService(const std::string& path, int port, FileSystem& files, Log log);

  // Returns the URL of the page, such as "http://127.0.0.1:40123/".
  std::string url() const;
  // Serves until stop().
  void run();
  // Makes run() return. May be called from any thread.
  void stop() {
    stopping_.cancel();
    http_.stop();
  }

 private:
  HttpOptions checked_options(int port);
  Response answer(Request& request);

  const std::string path_;
  const Log log_;
  OpenTileSources open_sources_;
  ConcurrencyLimiter tiles_;
  CancelToken stopping_;
  AccessControl access_;
  Router router_;
  HttpServer http_;
};

}  // namespace voxdag::server
