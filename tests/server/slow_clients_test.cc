// Clients that try to use up the memory or the connections of the service.
#include <sys/socket.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "core/base/clock.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

constexpr size_t kMaxConnections = 40;
constexpr size_t kAttackers = 64;
constexpr useconds_t kAttackBeginsUs = 1'500'000;  // above kMinExchangeWaitS (connection_table.cc)

class SlowClients : public RunningService {
 protected:
  SlowClients() { config_.http.limits.max_connections = kMaxConnections; }
  ~SlowClients() override {
    for (const int socket : sockets_) close(socket);
  }

  int port() const { return std::stoi(url().substr(url().rfind(':') + 1)); }
  // Opens a connection and sends as much of `bytes` as the kernel accepts without waiting.
  int open_with(const std::string& bytes) {
    sockets_.push_back(raw_connect(port()));
    send(sockets_.back(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    return sockets_.back();
  }
  // Sends twenty requests on separate connections. Returns how many are answered with 200.
  int answered() {
    int count = 0;
    for (int i = 0; i < 20; ++i)
      count += raw_exchange(port(), "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
                   .starts_with("HTTP/1.1 200");
    return count;
  }
  // Sends `bytes` repeatedly. Returns the number of bytes that the service accepts before it closes
  // the connection, at most about max_bytes.
  size_t bytes_taken(int socket, const std::string& bytes, size_t max_bytes) {
    size_t total = 0;
    while (total < max_bytes) {
      const ssize_t sent = send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent <= 0) break;
      total += static_cast<size_t>(sent);
    }
    return total;
  }
  // Returns the number of bytes in the kernel's send queues of the service's connections. Clients
  // have not read these bytes.
  size_t queued_bytes() {
    std::ifstream table("/proc/net/tcp");
    std::string line;
    std::getline(table, line);
    size_t total = 0;
    while (std::getline(table, line)) {
      std::istringstream fields(line);
      std::string number, local, remote, state, queues;
      fields >> number >> local >> remote >> state >> queues;
      if (std::stoul(local.substr(local.find(':') + 1), nullptr, 16) ==
          static_cast<unsigned long>(port()))
        total += std::stoul(queues, nullptr, 16);
    }
    return total;
  }

  std::vector<int> sockets_;
};

// Keeps kAttackers connections open. Each sends `begin` and then `piece` repeatedly. A connection
// that the service closes is replaced by a new one.
class EndlessRequests {
 public:
  EndlessRequests(int port, std::string begin, std::string piece)
      : thread_(
            [port, begin = std::move(begin), piece = std::move(piece)](const std::stop_token& end) {
              std::vector<int> sockets(kAttackers, -1);
              while (!end.stop_requested()) {
                for (int& socket : sockets) send_more(port, socket, begin, piece);
                std::this_thread::sleep_for(std::chrono::milliseconds(20));
              }
              for (const int socket : sockets) close(socket);
            }) {}

 private:
  static void send_more(int port, int& socket, const std::string& begin, const std::string& piece) {
    const auto put = [&](const std::string& bytes) {
      return send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT) >= 0 ||
             errno == EAGAIN;
    };
    if (socket >= 0 && put(piece)) return;
    close(socket);
    socket = raw_connect(port);
    put(begin);
  }

  std::jthread thread_;
};

// The service limits the length of the line before a chunk, of the chunk's extension, and of the
// trailer fields after the last chunk.
TEST_F(SlowClients, LinesOfChunksAreBounded) {
  start();
  const std::string head =
      "PUT /api/v1/scenes/a.glb HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n";
  constexpr size_t kMaxBytes = 64 << 20;
  for (const std::string begin : {"", "4;", "4\r\nglTF\r\n0\r\nX: "}) {
    SCOPED_TRACE(begin);
    EXPECT_LT(bytes_taken(open_with(head + begin), std::string(1 << 20, '0'), kMaxBytes),
              kMaxBytes);
  }
  EXPECT_EQ(answered(), 20);
}

// Connections whose bodies arrive very slowly are closed when other clients want to connect.
TEST_F(SlowClients, SlowBodiesDoNotBlockOthers) {
  start();
  for (size_t i = 0; i < kAttackers; ++i)
    open_with(
        "POST /api/v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
        "Content-Length: 60000\r\n\r\n{");
  usleep(kAttackBeginsUs);
  EXPECT_EQ(answered(), 20);
}

// Endless requests do not block other clients. Trailer fields and empty lines before a request have
// a limit of bytes, and a JSON body of tiny chunks has a deadline.
TEST_F(SlowClients, BodiesWithoutEndDoNotBlockOthers) {
  start();
  const std::string head =
      "POST /api/v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
      "Transfer-Encoding: chunked\r\n\r\n";
  std::string trailers, chunks, empty_lines;
  for (int i = 0; i < 400; ++i) {
    trailers += "a:b\r\n";
    chunks += "1\r\n \r\n";
    empty_lines += "\r\n";
  }
  const std::pair<std::string, std::string> attacks[] = {
      {head + "2\r\n{}\r\n0\r\n", trailers}, {head, chunks}, {"\r\n", empty_lines}};
  for (const auto& [begin, piece] : attacks) {
    SCOPED_TRACE(piece.substr(0, 5));
    const EndlessRequests attack(port(), begin, piece);
    usleep(kAttackBeginsUs);
    EXPECT_EQ(answered(), 20);
  }
}

// When other clients want to connect, the service closes connections whose answers are not read.
// The kernel's queues hold at most 300 KiB of the answers of each connection.
TEST_F(SlowClients, UnreadAnswersDoNotBlockOthers) {
  start();
  std::string requests;
  for (int i = 0; i < 1000; ++i)
    requests += "GET /openapi.json HTTP/1.1\r\nHost: localhost\r\n\r\n";
  for (size_t i = 0; i < kAttackers; ++i) open_with(requests);
  usleep(kAttackBeginsUs);
  const size_t queued = queued_bytes();
  EXPECT_GT(queued, kMaxConnections * (50 << 10)) << "the attack is on";
  EXPECT_LT(queued, kMaxConnections * (300 << 10));
  EXPECT_EQ(answered(), 20);
}

// A header field with a blank before its colon is rejected. If the service ignored the field
// Transfer-Encoding because of the blank, it would take the body for the next request.
TEST_F(SlowClients, ABlankBeforeTheColonIsRejected) {
  start();
  const std::string answer = raw_exchange(
      port(),
      "POST /api/v1/jobs HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding : chunked\r\n"
      "\r\nGET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 400 ")) << answer;
  EXPECT_EQ(answer.find("HTTP/1.1", 1), std::string::npos) << answer;
}

TEST_F(SlowClients, TwoHostsAreRejected) {
  start();
  EXPECT_TRUE(
      raw_exchange(port(), "GET /healthz HTTP/1.1\r\nHost: localhost\r\nHost: other\r\n\r\n")
          .starts_with("HTTP/1.1 400 "));
}

// Several clients that request /readyz concurrently all get the answer that the service is ready.
TEST_F(SlowClients, ReadinessDoesNotDependOnWhoElseAsks) {
  config_.transfers.max_requests_per_s = 0;
  start();
  std::string requests;
  for (int i = 0; i < 40; ++i) requests += "GET /readyz HTTP/1.1\r\nHost: localhost\r\n\r\n";
  requests += "GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  std::vector<std::string> answers(6);
  std::vector<std::thread> clients;
  for (std::string& answer : answers)
    clients.emplace_back([&, this] { answer = raw_exchange(port(), requests); });
  for (std::thread& client : clients) client.join();
  for (const std::string& answer : answers) {
    EXPECT_EQ(answer.find("HTTP/1.1 503"), std::string::npos);
    EXPECT_NE(answer.find("{\"status\":\"ready\"}"), std::string::npos);
  }
}

// The metrics also count malformed requests, which are refused before they reach a route.
TEST_F(SlowClients, MalformedRequestsAreCounted) {
  start();
  raw_exchange(port(), "hello\r\n\r\n");
  EXPECT_NE(http_->get("/metrics").body.find("voxdag_http_requests_total{status=\"400\"} 1"),
            std::string::npos);
}

// A Range header has no effect on a HEAD request.
TEST_F(SlowClients, HeadIgnoresRanges) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
  ASSERT_TRUE(until_state(id, "succeeded"));
  EXPECT_TRUE(raw_exchange(port(), "HEAD /api/v1/jobs/" + id +
                                       "/dag HTTP/1.1\r\nHost: localhost\r\nRange: bytes=0-3\r\n"
                                       "Connection: close\r\n\r\n")
                  .starts_with("HTTP/1.1 200"));
}

}  // namespace
}  // namespace voxdag::server
