// The service as one object: what `voxdag serve` runs, given a configuration. Thread-safe.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "core/io/file_system.h"
#include "server/config.h"

namespace voxdag::server {

class Service {
 public:
  // Writes a line of the log: what changed, by whom, and what went wrong.
  using Log = std::function<void(const std::string& line)>;

  // Checks the configuration, locks the data folder (one service at a time), opens the stores,
  // resumes the jobs of the last service, and listens. Throws Error.
  Service(ServerConfig config, FileSystem& files, Log log);
  ~Service();

  int port() const;
  // "http://127.0.0.1:8080"
  std::string url() const;
  // Serves until stop(). Then builds stop at a checkpoint, requests in progress finish, and it
  // returns.
  void run();
  // From any thread.
  void stop();

 private:
  class Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace voxdag::server
