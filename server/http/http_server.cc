#include "server/http/http_server.h"

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <new>
#include <thread>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "server/api/problem.h"
#include "server/http/connection/connection.h"
#include "server/http/connection/connection_table.h"
#include "server/http/connection/listener.h"
#include "server/http/connection/thread_pool.h"
#include "server/http/connection/tls.h"
#include "server/http/exchange.h"

namespace voxdag::server {
namespace {

// To whom there is no place for, in as many bytes as any socket takes at once.
void send_full(int socket) {
  const std::string body = problem_json(busy("all places are taken"));
  const std::string text =
      "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/problem+json\r\n"
      "Retry-After: 2\r\nConnection: close\r\nContent-Length: " +
      std::to_string(body.size()) + "\r\n\r\n" + body;
  [[maybe_unused]] const ssize_t sent =
      send(socket, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

// The exchange that this thread is in. httplib hands its own request and answer around, and knows
// nothing of whose connection they came by.
thread_local Exchange* t_exchange = nullptr;

}  // namespace

// httplib does the HTTP: its process_request() is all that is used of its server. Sockets, threads
// and time are ours, because it would let a few slow clients take all its threads.
class HttpServer::Engine : private httplib::Server {
 public:
  Engine(const HttpOptions& options, HttpServer::Handler handler, OnFault on_fault)
      : limits_(options.limits),
        handler_(std::move(handler)),
        on_fault_(std::move(on_fault)),
        listener_(options.address, options.port),
        table_(limits_) {
    if (!options.certificate_file.empty()) tls_.emplace(options.certificate_file, options.key_file);
    svr_sock_ = 0;  // any valid one: httplib ends answers when it is not
    set_keep_alive_timeout(static_cast<time_t>(limits_.idle_s));
    set_keep_alive_max_count(limits_.requests_each);
    register_handlers();
  }

  int port() const { return listener_.port(); }
  size_t connections() const { return table_.size(); }
  void stop() {
    draining_ = true;
    listener_.stop();
  }

  void run(double drain_s) {
    listener_.accept_all([this](int socket, const std::string& address) { take(socket, address); });
    const double deadline = wall_seconds() + drain_s;
    while (table_.size() > 0 && wall_seconds() < deadline) {
      table_.hang_up_waiting();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    svr_sock_ = INVALID_SOCKET;
    table_.hang_up_all();
    crew_.reset();
  }

 private:
  void register_handlers() {
    // Every request is routed by us: begin() has made its path "/".
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
    // Methods that httplib knows and nobody asks for with good intent: TRACE, CONNECT.
    set_pre_routing_handler([this](const auto& raw, auto& out) {
      if (std::string_view("GET HEAD POST PUT PATCH DELETE OPTIONS").find(raw.method) !=
          std::string_view::npos)
        return HandlerResponse::Unhandled;
      answer(out, nullptr);
      return HandlerResponse::Handled;
    });
    set_error_handler([](const httplib::Request&, httplib::Response& out) {
      if (out.body.empty() && !out.content_provider_) t_exchange->refuse(out);
    });
  }

  void take(int socket, const std::string& address) {
    ConnectionTable::Place place;
    if (draining_ || !table_.admit(socket, address, place)) {
      send_full(socket);
      close(socket);
      return;
    }
    try {
      crew_->run([this, socket, address, place] {
        try {
          serve(socket, address, place);
        } catch (const std::exception&) {
          // No memory even to begin: this client is lost, the others are not.
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
    if (!connection.greet()) return;
    for (size_t served = 1; served <= limits_.requests_each && !draining_; ++served) {
      table_.set_waiting(place, true);
      if (!connection.wait_for_request()) return;
      Exchange exchange(connection, address);
      t_exchange = &exchange;
      bool closed = false;
      const bool ok = process_request(connection, served == limits_.requests_each || draining_,
                                      closed, [&](httplib::Request& raw) {
                                        table_.set_waiting(place, false);
                                        exchange.begin(raw);
                                      });
      t_exchange = nullptr;
      if (connection.trouble() == Connection::Trouble::kBroken) return;
      if (!ok || closed || !exchange.is_whole()) {
        exchange.say_why_not();
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
    } catch (const Error& error) {
      on_fault_(exchange.request(), error.message());
      response = problem_response(public_problem(error));
    } catch (const std::bad_alloc&) {
      on_fault_(exchange.request(), "out of memory");
      response = problem_response(busy("the service has no memory for this now"));
    } catch (const std::exception& fault) {
      on_fault_(exchange.request(), fault.what());
      response = problem_response(
          Problem(500, "internal", "a fault of the service; its log has the request's id"));
    }
    exchange.put(std::move(response), out, draining_);
  }

  const HttpLimits limits_;
  const HttpServer::Handler handler_;
  const OnFault on_fault_;
  Listener listener_;
  std::optional<TlsContext> tls_;
  ConnectionTable table_;
  std::atomic<bool> draining_{false};
  // Last: its threads use all of the above.
  std::unique_ptr<ThreadPool> crew_ = std::make_unique<ThreadPool>();
};

HttpServer::HttpServer(const HttpOptions& options, Handler handler, OnFault on_fault)
    : engine_(std::make_unique<Engine>(options, std::move(handler), std::move(on_fault))) {}
HttpServer::~HttpServer() = default;
int HttpServer::port() const { return engine_->port(); }
size_t HttpServer::connections() const { return engine_->connections(); }
void HttpServer::run(double drain_s) { engine_->run(drain_s); }
void HttpServer::stop() { engine_->stop(); }

}  // namespace voxdag::server
