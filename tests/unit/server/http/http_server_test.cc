#include "server/http/http_server.h"

#include <gtest/gtest.h>

#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/http_client.h"
#include "server/http/connection/connection_table.h"

namespace voxdag::server {
namespace {

// Answers with a body of as many bytes as the path says, and keeps what OnAnswer reports.
class SizedAnswers {
 public:
  using Report = std::pair<std::string, int>;  // the path, or "" without a request; the status

  SizedAnswers()
      : server_(
            options(),
            [](Request& request) {
              const size_t bytes = std::stoul(request.target.segments[0]);
              return make_response(200, "text/plain", "no-store", std::string(bytes, 'x'));
            },
            [this](const Request* request, int status) {
              const std::lock_guard lock(mutex_);
              reports_.emplace_back(request ? request->target.path : "", status);
            }),
        thread_([this] { server_.run(0); }) {}
  ~SizedAnswers() {
    server_.stop();
    thread_.join();
  }
  std::string url() const { return "http://127.0.0.1:" + std::to_string(server_.port()); }
  std::vector<Report> reports() {
    const std::lock_guard lock(mutex_);
    return reports_;
  }

 private:
  static HttpOptions options() {
    HttpOptions options;
    options.port = 0;
    return options;
  }

  std::mutex mutex_;  // guards reports_
  std::vector<Report> reports_;
  HttpServer server_;
  std::thread thread_;
};

// The reported status is the one that the client receives, also if the server replaces an answer
// for which it has no memory.
TEST(HttpServer, ReportsTheStatusesThatItSends) {
  SizedAnswers server;
  client::HttpClient http({server.url(), "", "", 300});
  const std::string too_large = "/" + std::to_string(ConnectionTable::kMaxAnswerBytes + 1);
  EXPECT_EQ(http.get("/100000").body.size(), 100000u);
  const auto busy = http.get(too_large);
  EXPECT_EQ(busy.status, 503);
  EXPECT_NE(busy.body.find("\"busy\""), std::string::npos) << busy.body;
  EXPECT_EQ(http.get("/1").status, 200) << "the connection remains open";
  EXPECT_EQ(http.send("POST", "/1", "x", {{"Content-Encoding", "gzip"}}).status, 415);
  using Reports = std::vector<SizedAnswers::Report>;
  EXPECT_EQ(server.reports(),
            (Reports{{"/100000", 200}, {too_large, 503}, {"/1", 200}, {"", 415}}));
}

}  // namespace
}  // namespace voxdag::server
