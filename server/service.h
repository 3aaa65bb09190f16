// The complete service as one object, for `voxdag serve`. Thread-safe.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>

#include "server/api/access/access_control.h"
#include "server/api/context/context.h"
#include "server/api/routing/router.h"
#include "server/base/clock_guard.h"
#include "server/http/http_server.h"
#include "server/webhooks/webhooks.h"

namespace voxdag::server {

class Service {
 public:
  // Checks the configuration, locks the data folder, opens the databases, resumes the jobs of the
  // previous service, and listens. `log` receives failures, and an entry for every request that
  // changes something, with the name of the caller's token; with ServerConfig::access_log, also an
  // entry for every other request. The texts of the entries are printable. Throws Error.
  Service(ServerConfig config, FileSystem& files, Log log);

  int port() const { return http_.port(); }
  // Returns the base URL, such as "http://127.0.0.1:8080".
  std::string url() const;
  // Serves until stop(). Then stops builds at a checkpoint, waits for requests in progress up to
  // ServerConfig::drain_timeout_s, and returns.
  void run();
  // Makes run() return. May be called from any thread.
  void stop();

 private:
  // Runs until the service stops.
  void clean_up_periodically();
  Response answer(Request& request);
  // Counts the request, whose answer has this status. Logs it, unless it only reads and there is no
  // access log.
  void record(const Request& request, int status);

  const ServerConfig config_;
  FileSystem& files_;
  const Log log_;
  Steps steps_;
  const std::unique_ptr<FileLock> lock_;
  DiskSpace disk_;
  std::atomic<bool> draining_{false};
  Metrics metrics_;
  AccessControl access_;
  JobQueue queue_;
  SceneStore scenes_;
  ClockGuard clock_;  // for the retention of uploads
  TaskResolver tasks_;
  HttpServer http_;
  Webhooks webhooks_;
  Dispatcher dispatcher_;
  Context context_;
  Router router_{context_};
  std::mutex stop_mutex_;
  std::condition_variable stop_wake_;  // notified when draining_ becomes true
};

}  // namespace voxdag::server
