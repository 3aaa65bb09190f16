#include "server/http/http_server.h"

#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>

#include "core/base/clock.h"
#include "server/http/connection/connection.h"
#include "server/http/connection/connection_table.h"
#include "server/http/connection/listener.h"
#include "server/http/connection/thread_pool.h"
#include "server/http/connection/tls.h"
#include "server/http/exchange.h"
#include "server/http/message/problem.h"

namespace voxdag::server {
namespace {

// Answers a connection that exceeds the limit with status 503, in one nonblocking write.
void send_busy(int socket) {
  const std::string body =
      problem_json(busy("too many connections are open: expected a new connection later"));
  const std::string text =
      "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/problem+json\r\n"
      "Retry-After: 2\r\nConnection: close\r\nContent-Length: " +
      std::to_string(body.size()) + "\r\n\r\n" + body;
  [[maybe_unused]] const ssize_t sent =
      send(socket, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

}  // namespace

class HttpServer::Engine {
 public:
  Engine(const HttpOptions& options, HttpServer::Handler handler, HttpServer::OnAnswer on_answer)
      : limits_(options.limits),
        handler_(std::move(handler)),
        on_answer_(std::move(on_answer)),
        listener_(options.address, options.port),
        table_(limits_) {
    if (!options.certificate_file.empty()) tls_.emplace(options.certificate_file, options.key_file);
  }

  int port() const { return listener_.port(); }
  size_t connections() const { return table_.size(); }
  void stop() {
    draining_ = true;
    listener_.stop();
  }

  void run(double drain_s) {
    listener_.accept_all(
        [this](int socket, const std::string& address) { accept(socket, address); });
    const double deadline = wall_seconds() + drain_s;
    while (table_.size() > 0 && wall_seconds() < deadline) {
      table_.close_waiting();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    table_.close_all();
    threads_.reset();
  }

 private:
  // An exception (no memory for the connection, or no thread) closes only this connection, not the
  // listener.
  void accept(int socket, const std::string& address) try {
    ConnectionTable::Place place;
    if (draining_ || !table_.admit(socket, address, place)) {
      send_busy(socket);
      close(socket);
      return;
    }
    const auto end = [this, socket, place] {
      table_.remove(place);
      close(socket);
    };
    try {
      threads_->run([this, socket, address, place, end] {
        try {
          serve(socket, address, place);
        } catch (const std::exception&) {
        }
        end();
      });
    } catch (const std::exception&) {
      end();
    }
  } catch (const std::exception&) {
    close(socket);
  }

  void serve(int socket, const std::string& address, ConnectionTable::Place place) {
    Connection connection(socket, limits_, tls_ ? tls_->session(socket) : TlsSession{}, table_,
                          place);
    if (!connection.handshake()) return;
    for (size_t served = 1; !draining_; ++served) {
      if (!connection.wait_for_request()) return;
      Exchange exchange(connection, address);
      const Request* request = nullptr;
      Response response = respond(exchange, request);
      const bool last = served == limits_.max_requests || draining_;
      const auto on_status = [&](int status) { on_answer_(request, status); };
      if (!exchange.answer(std::move(response), last, on_status)) break;
    }
    connection.linger();
  }

  // Sets `request` when the handler is called.
  Response respond(Exchange& exchange, const Request*& request) {
    try {
      Request& read = exchange.read_request(limits_.max_header_bytes);
      request = &read;
      return handler_(read);
    } catch (const Problem& problem) {
      return problem_response(problem);
    } catch (const std::exception&) {
      return problem_response(Problem(500, "internal", "internal error"));
    }
  }

  const HttpLimits limits_;
  const HttpServer::Handler handler_;
  const HttpServer::OnAnswer on_answer_;
  Listener listener_;
  std::optional<TlsContext> tls_;
  ConnectionTable table_;
  std::atomic<bool> draining_{false};
  // Must be the last member, so that its threads end before the destructors of the other members
  // run.
  std::unique_ptr<ThreadPool> threads_ = std::make_unique<ThreadPool>();
};

HttpServer::HttpServer(const HttpOptions& options, Handler handler, OnAnswer on_answer)
    : engine_(std::make_unique<Engine>(options, std::move(handler), std::move(on_answer))) {}
HttpServer::~HttpServer() = default;
int HttpServer::port() const { return engine_->port(); }
size_t HttpServer::connections() const { return engine_->connections(); }
void HttpServer::run(double drain_s) { engine_->run(drain_s); }
void HttpServer::stop() { engine_->stop(); }

}  // namespace voxdag::server
