#include "server/http/http_server.h"

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "core/base/clock.h"
#include "server/http/connection/connection.h"
#include "server/http/connection/connection_table.h"
#include "server/http/connection/listener.h"
#include "server/http/connection/thread_pool.h"
#include "server/http/connection/tls.h"
#include "server/http/exchange.h"
#include "server/http/problem.h"

namespace voxdag::server {
namespace {

// Answers a connection over the limit, in one write that never blocks.
void send_busy(int socket) {
  const std::string body = problem_json(busy("too many connections"));
  const std::string text =
      "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/problem+json\r\n"
      "Retry-After: 2\r\nConnection: close\r\nContent-Length: " +
      std::to_string(body.size()) + "\r\n\r\n" + body;
  [[maybe_unused]] const ssize_t sent =
      send(socket, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

// The exchange of this thread's connection: httplib passes only its own request and answer to the
// handlers.
thread_local Exchange* t_exchange = nullptr;

}  // namespace

// Of httplib's server only process_request() is used. Sockets, threads and timeouts are ours,
// because with httplib's a few slow clients can occupy all threads.
class HttpServer::Engine : private httplib::Server {
 public:
  Engine(const HttpOptions& options, HttpServer::Handler handler)
      : limits_(options.limits),
        handler_(std::move(handler)),
        listener_(options.address, options.port),
        table_(limits_) {
    if (!options.certificate_file.empty()) tls_.emplace(options.certificate_file, options.key_file);
    svr_sock_ = 0;  // any valid number: httplib aborts answers without one
    set_keep_alive_timeout(static_cast<time_t>(limits_.idle_timeout_s));
    set_keep_alive_max_count(limits_.max_requests);
    register_handlers();
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
    svr_sock_ = INVALID_SOCKET;
    table_.close_all();
    threads_.reset();
  }

 private:
  void register_handlers() {
    // Exchange::begin() sets every path to "/": routing is the handler's.
    const Handler plain = [this](const auto&, auto& out) { answer(out, nullptr); };
    const HandlerWithContentReader with_body = [this](const auto&, auto& out, const auto& reader) {
      answer(out, &reader);
    };
    Get("/", plain);
    Options("/", plain);
    Delete("/", plain);
    Post("/", with_body);
    Put("/", with_body);
    Patch("/", with_body);
    Delete("/", with_body);
    // httplib also knows methods that no route of ours has: TRACE, CONNECT, ...
    set_pre_routing_handler([this](const auto& raw, auto& out) {
      if (std::string_view("GET HEAD POST PUT PATCH DELETE OPTIONS").find(raw.method) !=
          std::string_view::npos)
        return HandlerResponse::Unhandled;
      answer(out, nullptr);
      return HandlerResponse::Handled;
    });
    set_error_handler([](const httplib::Request&, httplib::Response& out) {
      if (out.body.empty() && !out.content_provider_) t_exchange->answer_error(out);
    });
  }

  void accept(int socket, const std::string& address) {
    ConnectionTable::Place place;
    if (draining_ || !table_.admit(socket, address, place)) {
      send_busy(socket);
      close(socket);
      return;
    }
    try {
      threads_->run([this, socket, address, place] {
        try {
          serve(socket, address, place);
        } catch (const std::exception&) {
          // Out of memory: only this connection is lost.
        }
        table_.remove(place);
        close(socket);
      });
    } catch (const std::system_error&) {
      table_.remove(place);
      close(socket);
    }
  }

  void serve(int socket, const std::string& address, ConnectionTable::Place place) {
    Connection connection(socket, address, limits_, tls_ ? tls_->session(socket) : TlsSession{});
    if (!connection.handshake()) return;
    for (size_t served = 1; served <= limits_.max_requests && !draining_; ++served) {
      table_.set_waiting(place, true);
      if (!connection.wait_for_request()) return;
      Exchange exchange(connection, address);
      t_exchange = &exchange;
      bool closed = false;
      const bool ok = process_request(connection, served == limits_.max_requests || draining_,
                                      closed, [&](httplib::Request& raw) {
                                        table_.set_waiting(place, false);
                                        exchange.begin(raw);
                                      });
      t_exchange = nullptr;
      if (connection.error_state() == Connection::ErrorState::kBroken) return;
      if (!ok || closed || !exchange.is_complete()) {
        exchange.send_error();
        break;
      }
    }
    connection.linger();
  }

  void answer(httplib::Response& out, const httplib::ContentReader* reader) {
    Exchange& exchange = *t_exchange;
    Response response;
    try {
      exchange.check(reader);
      response = handler_(exchange.request());
    } catch (const Problem& problem) {
      response = problem_response(problem);
    } catch (const std::exception&) {
      response = problem_response(Problem(500, "internal", "internal error"));
    }
    exchange.answer(std::move(response), out, draining_);
  }

  const HttpLimits limits_;
  const HttpServer::Handler handler_;
  Listener listener_;
  std::optional<TlsContext> tls_;
  ConnectionTable table_;
  std::atomic<bool> draining_{false};
  // The last member, because its threads use the others.
  std::unique_ptr<ThreadPool> threads_ = std::make_unique<ThreadPool>();
};

HttpServer::HttpServer(const HttpOptions& options, Handler handler)
    : engine_(std::make_unique<Engine>(options, std::move(handler))) {}
HttpServer::~HttpServer() = default;
int HttpServer::port() const { return engine_->port(); }
size_t HttpServer::connections() const { return engine_->connections(); }
void HttpServer::run(double drain_s) { engine_->run(drain_s); }
void HttpServer::stop() { engine_->stop(); }

}  // namespace voxdag::server
