#include <sys/socket.h>
#include <unistd.h>

#include <random>

#include "core/base/clock.h"
#include "core/base/text/printable.h"
#include "server/api/access/tokens.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

class Hostile : public RunningService {
 protected:
  int port() const { return std::stoi(url().substr(url().rfind(':') + 1)); }
  int status(const std::string& bytes) {
    const std::string answer = raw_exchange(port(), bytes);
    return answer.size() > 12 ? std::stoi(answer.substr(9, 3)) : 0;
  }
};

// Malformed requests, and requests whose end is ambiguous, are rejected.
TEST_F(Hostile, MalformedRequestsAreRejected) {
  start();
  EXPECT_EQ(status("hello\r\n\r\n"), 400);
  EXPECT_EQ(status("GET /healthz\r\n\r\n"), 400);
  EXPECT_EQ(status("GET /%zz HTTP/1.1\r\nHost: localhost\r\n\r\n"), 400);
  EXPECT_EQ(status("TRACE / HTTP/1.1\r\nHost: localhost\r\n\r\n"), 405);
  EXPECT_EQ(status("POST /api/v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n"
                   "Content-Length: 6\r\n\r\nhello"),
            400);
  EXPECT_EQ(status("POST /api/v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: x\r\n\r\n"),
            400);
  EXPECT_EQ(status("POST /api/v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\n"
                   "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"),
            400);
  EXPECT_EQ(status("GET /" + std::string(9000, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n"), 400);
  EXPECT_EQ(status("a\nGET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"), 400);
  EXPECT_EQ(status("\r\nGET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"), 200);
  for (const std::string field : {"Authorization: Bearer a", "Content-Range: bytes 0-4/5",
                                  "Idempotency-Key: a", "Range: bytes=0-1", "Origin: a"})
    EXPECT_EQ(status("GET /healthz HTTP/1.1\r\nHost: localhost\r\n" + field + "\r\n" + field +
                     "\r\n\r\n"),
              400)
        << field;
  std::string many = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n";
  for (int i = 0; i < 2000; ++i) many += "X-Filler: 0123456789012345678901234567890\r\n";
  EXPECT_EQ(status(many + "\r\n"), 431);
  EXPECT_EQ(status("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"), 200);
}

// If the service refuses a request before it reads the body, it closes the connection. It does not
// take the body for the next request.
TEST_F(Hostile, AnUnreadBodyClosesTheConnection) {
  start();
  const std::string answer = raw_exchange(
      port(),
      "POST /api/v1/jobs/none/cancel HTTP/1.1\r\nHost: localhost\r\n"
      "Content-Length: 44\r\n\r\nGET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n\r\n");
  EXPECT_EQ(answer.find("\"ok\""), std::string::npos) << answer;
  EXPECT_NE(answer.find("Connection: close"), std::string::npos) << answer;
}

// The service refuses an upload because of its header. The client, like some proxies, sends the
// complete body before it reads the answer. It must get the answer, not a connection error.
TEST_F(Hostile, ARefusalReachesAClientThatSendsAllFirst) {
  start();
  const std::string body(8 << 20, 'x');
  const int socket = raw_connect(port());
  const std::string request =
      "PUT /api/v1/scenes/a.glb HTTP/1.1\r\nHost: localhost\r\nContent-Encoding: gzip\r\n"
      "Content-Length: " +
      std::to_string(body.size()) + "\r\n\r\n" + body;
  EXPECT_EQ(send(socket, request.data(), request.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(request.size()));
  std::string answer(4096, '\0');
  EXPECT_GT(recv(socket, answer.data(), answer.size(), 0), 0);
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 415 ")) << answer;
  close(socket);
}

TEST_F(Hostile, TooLargeBodiesAreRejected) {
  config_.transfers.max_scene_bytes = 1000;
  start();
  EXPECT_EQ(not_problem(put_scene("a.glb", std::string(1001, 'x')), 413, "too_large"), "");
  const std::string chunk(600, 'x');
  EXPECT_EQ(status("PUT /api/v1/scenes/a.glb HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: "
                   "chunked\r\n\r\n258\r\n" +
                   chunk + "\r\n258\r\n" + chunk + "\r\n0\r\n\r\n"),
            413);
  const Json large = {{"scene", std::string(70000, 'a')}, {"resolution", 64}};
  EXPECT_EQ(not_problem(post("/api/v1/jobs", large), 413, "too_large"), "");
  EXPECT_EQ(not_problem(http_->send("POST", "/api/v1/jobs", "{}", {{"Content-Encoding", "gzip"}}),
                        415, "unsupported_media_type"),
            "");
}

// A job request that is too long is rejected, because the service stores most of it and every
// answer about the job contains it.
TEST_F(Hostile, LongRequestsAreRejected) {
  start();
  put_scene("a.glb", scene_bytes());
  const auto request_of = [](const std::string& scene) {
    return Json{{"scene", std::vector<std::string>(64, scene)}, {"resolution", 64}};
  };
  EXPECT_EQ(post("/api/v1/jobs", request_of("a.glb")).status, 202);
  const std::string long_path = "/" + std::string(600, 'a') + ".glb";
  const ClientResponse answer = post("/api/v1/jobs", request_of(long_path));
  EXPECT_EQ(not_problem(answer, 400, "invalid_input"), "");
  EXPECT_NE(answer.body.find("at most 32768"), std::string::npos) << answer.body;
}

// An upload with an empty chunked body is rejected, because it has no scene.
TEST_F(Hostile, EmptyScenesAreRejected) {
  start();
  const std::string head = "PUT /api/v1/scenes/a.glb HTTP/1.1\r\nHost: localhost\r\n";
  EXPECT_EQ(status(head + "Content-Length: 0\r\n\r\n"), 400);
  EXPECT_EQ(status(head + "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"), 400);
  EXPECT_EQ(http_->get("/api/v1/scenes/a.glb").status, 404);
}

// The answer to HEAD has the header fields of the answer to GET. For an event stream, neither has a
// Content-Length.
TEST_F(Hostile, HeadOfAStreamHasNoLength) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
  const std::string answer =
      raw_exchange(port(), "HEAD /api/v1/jobs/" + id +
                               "/events HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 ")) << answer;
  EXPECT_NE(answer.find("Transfer-Encoding: chunked"), std::string::npos) << answer;
  EXPECT_EQ(answer.find("Content-Length"), std::string::npos) << answer;
}

// Answers and logs do not contain the control characters of texts in scenes. A job's name with
// control characters is rejected.
TEST_F(Hostile, TextsOfScenesArePrintable) {
  start();
  const std::string uri = "%1b%5b31m%0aforged%3a%20done%c2%9b%e2%80%ae.bin";
  const Json scene = {
      {"asset", {{"version", "2.0"}}},
      {"buffers", {{{"byteLength", 36}, {"uri", uri}}}},
      {"bufferViews", {{{"buffer", 0}, {"byteLength", 36}}}},
      {"accessors", {{{"bufferView", 0}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}}}},
      {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}}},
      {"nodes", {{{"mesh", 0}}}},
      {"scenes", {{{"nodes", {0}}}}},
      {"scene", 0}};
  put_scene("a.gltf", scene.dump());
  const std::string id = post_job({{"scene", "a.gltf"}, {"resolution", 64}});
  ASSERT_TRUE(until([&] { return job(id)["state"] == "failed"; }));
  const std::string message = job(id)["error"]["message"];
  EXPECT_NE(message.find("forged: done"), std::string::npos) << message;
  EXPECT_TRUE(is_printable(message)) << message;
  const std::string log_of_job = http_->get("/api/v1/jobs/" + id + "/log").body;
  EXPECT_EQ(printable_lines(log_of_job), log_of_job);
  EXPECT_EQ(log_of_job.find("\nforged"), std::string::npos) << log_of_job;
  EXPECT_EQ(printable_lines(log()), log());
  const ClientResponse dry =
      post("/api/v1/jobs?dry_run=true", {{"scene", "a.gltf"}, {"resolution", 64}});
  EXPECT_TRUE(is_printable(Json::parse(dry.body)["detail"].get<std::string>())) << dry.body;
  for (const char* name : {"a\u009b31m", "a\u202eb", "a\nb", "a\u007f"})
    EXPECT_EQ(
        not_problem(post("/api/v1/jobs", {{"scene", "a.gltf"}, {"resolution", 64}, {"name", name}}),
                    400, "invalid_input"),
        "");
}

// The service ignores the content type of a scene, so it does not parse a multipart body.
TEST_F(Hostile, MultipartBodiesAreNotParsed) {
  start();
  const client::HeaderMap form = {{"Content-Type", "multipart/form-data; boundary=x"}};
  EXPECT_EQ(status("PUT /api/v1/scenes/a.glb HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n"
                   "Content-Type: multipart/form-data; boundary=x\r\n\r\n--x\r\n"),
            201);
  EXPECT_EQ(
      not_problem(http_->send("POST", "/api/v1/jobs/none/cancel", "", form), 404, "not_found"), "");
}

TEST_F(Hostile, NamesCannotLeaveTheFolder) {
  start();
  for (const char* name :
       {"..%2f..%2fx.glb", "%2fetc%2fx.glb", "..%5cx.glb", "x.glb%00", ".glb", "x", "%e4.glb"}) {
    SCOPED_TRACE(name);
    EXPECT_EQ(put_scene(name, "x").status, 400);
  }
  EXPECT_EQ(put_scene("../x.glb", "x").status, 404);
}

// Clients that send their requests slowly do not prevent other clients from being answered.
TEST_F(Hostile, SlowClientsDoNotBlockOthers) {
  config_.http.limits.max_connections = 40;
  start();
  std::vector<int> slow;
  for (int i = 0; i < 64; ++i) {
    slow.push_back(raw_connect(port()));
    const std::string request_start = "GET /healthz HTTP/1.1\r\nX-Slow: ";
    send(slow.back(), request_start.data(), request_start.size(), MSG_NOSIGNAL);
  }
  for (int i = 0; i < 20; ++i)
    EXPECT_EQ(status("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"), 200);
  for (const int socket : slow) close(socket);
}

// The service closes a connection if the header of its request does not arrive in time.
TEST_F(Hostile, HeadersTimeOut) {
  config_.http.limits.header_timeout_s = 0.2;
  start();
  const int socket = raw_connect(port());
  const std::string begin = "GET /healthz HTTP/1.1\r\n";
  send(socket, begin.data(), begin.size(), MSG_NOSIGNAL);
  std::string answer(4096, '\0');
  const ssize_t got = recv(socket, answer.data(), answer.size(), 0);
  ASSERT_GT(got, 0);
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 408")) << answer;
  close(socket);
}

TEST_F(Hostile, TokensAreRequired) {
  const NewToken reader = make_token("read", "r");
  write_file_atomically(system_files(), folder_.file("tokens"), reader.line + "\n");
  config_.token_file = folder_.file("tokens");
  start();
  EXPECT_EQ(not_problem(http_->get("/api/v1/jobs"), 401, "unauthorized"), "");
  EXPECT_EQ(http_->get("/healthz").status, 200);
  EXPECT_EQ(http_->get("/metrics").status, 401);
  HttpClient client({url(), reader.token, "", 60});
  EXPECT_EQ(client.get("/api/v1/jobs").status, 200);
  EXPECT_EQ(client.send("DELETE", "/api/v1/scenes/a.glb\x9b", "").status, 403);
  // The log names the client that was refused, and contains no byte that controls a terminal.
  EXPECT_NE(log().find("audit DELETE /api/v1/scenes/a.glb%9b status=403 who=r"), std::string::npos)
      << log();
}

// Random bytes in requests never end the service.
TEST_F(Hostile, SurvivesRandomBytes) {
  start();
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  const std::string good =
      "POST /api/v1/jobs?dry_run=false HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
      "application/json\r\nContent-Length: 34\r\n\r\n{\"scene\":\"a.glb\",\"resolution\":64} ";
  for (int i = 0; i < 100; ++i) {
    std::string bytes = good;
    for (int flips = 0; flips < 4; ++flips)
      bytes[random() % bytes.size()] = static_cast<char>(random());
    bytes.resize(1 + random() % bytes.size());
    raw_exchange(port(), bytes);
  }
  EXPECT_EQ(http_->get("/healthz").status, 200);
}

}  // namespace
}  // namespace voxdag::server
