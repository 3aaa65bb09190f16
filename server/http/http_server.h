// HTTP/1.1 on one port (docs/decisions/sockets.md). The handler runs on the connection's thread, so
// many calls run concurrently.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "server/http/connection/limits.h"
#include "server/http/message/message.h"

namespace voxdag::server {

struct HttpOptions {
  std::string address = "127.0.0.1";
  int port = 8080;               // 0: any free port
  std::string certificate_file;  // "": plain HTTP
  std::string key_file;
  HttpLimits limits;
};

class HttpServer {
 public:
  // Answers a request. May throw Problem. If it throws another exception, the answer is the problem
  // `internal`.
  using Handler = std::function<Response(Request&)>;
  // Called with the status of each answer, before the answer is sent. The status can differ from
  // the status that the handler returned: it is 503 if there is no memory for the answer. `request`
  // is null if the handler was not called, because the head of the request is malformed, too large
  // or too slow, or has a Content-Encoding.
  using OnAnswer = std::function<void(const Request* request, int status)>;

  // Listens, but does not accept connections yet. Throws like Listener and TlsContext.
  HttpServer(
      const HttpOptions& options, Handler handler, OnAnswer on_answer = [](const Request*, int) {});
  ~HttpServer();

  int port() const;
  size_t connections() const;
  // Serves until stop(), then waits up to `drain_s` for answers in progress.
  void run(double drain_s);
  // Makes run() return. May be called from any thread. Does not end event streams: their
  // EventSource must return nullopt.
  void stop();

 private:
  class Engine;
  std::unique_ptr<Engine> engine_;
};

}  // namespace voxdag::server
