// HTTP on one port: connections within their limits, requests parsed and answers written by
// httplib, handlers called with messages of our own. A handler runs on its connection's thread;
// many run at a time.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/http/limits.h"
#include "server/http/message.h"

namespace voxdag::server {

struct HttpOptions {
  std::string address = "127.0.0.1";
  int port = 8080;               // 0 for any free one
  std::string certificate_file;  // "" for plain HTTP
  std::string key_file;
  HttpLimits limits;
};

class HttpServer {
 public:
  // May throw Problem; an Error becomes the problem of its code, anything else is `internal`.
  using Handler = std::function<Response(Request&)>;
  // Told of faults that clients see as `internal` and the like, for the log.
  using OnFault = std::function<void(const Request&, const std::string& what)>;

  // Listens, but accepts nobody yet. Throws as Listener and TlsContext do.
  HttpServer(const HttpOptions& options, Handler handler, OnFault on_fault);
  ~HttpServer();

  int port() const;
  size_t connections() const;
  // Serves until stop(), then lets answers in flight finish for up to `drain_s`.
  void run(double drain_s);
  // From any thread. Event streams must end by themselves.
  void stop();

 private:
  class Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace voxdag::server
