// Damaged files in viewers, and clients that are slow, disconnect, or come from other sites.
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <optional>
#include <thread>

#include "core/format/global/open_global.h"
#include "server/view_service.h"
#include "tests/server/running_service.h"
#include "tests/support/flip_bits.h"

namespace voxdag::server {
namespace {

struct Answers : RunningService {
  using RunningService::not_problem;
};

// Serves a colored file with several checksum blocks, as `voxdag view` does.
class HostileView : public testing::Test {
 protected:
  void SetUp() override {
    const std::string program = VOXDAG_BINARY, scene = folder_.file("m.glb");
    const std::string command =
        program + " generate city " + scene + " --triangles 20000 --colors >/dev/null 2>&1 && " +
        program + " build " + scene + " -r 512 --color -o " + path_ + " >/dev/null 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0);
  }
  ~HostileView() override {
    if (service_) service_->stop();
    if (thread_.joinable()) thread_.join();
  }
  void start() {
    service_.emplace(path_, 0, system_files(), [this](const LogEntry& entry) {
      const std::lock_guard lock(log_mutex_);
      log_ += entry.message + "\n";
    });
    thread_ = std::thread([this] { service_->run(); });
    const std::string url = service_->url();
    http_.emplace(ClientOptions{url.substr(0, url.size() - 1), "", "", 60});
    digest_ = Json::parse(http_->get("/api/v1/view/tiles").body)["digest"];
  }
  ClientResponse get(const std::string& what) {
    return http_->get("/api/v1/view/tiles/" + what + (what.find('?') == what.npos ? "?" : "&") +
                      "v=" + digest_);
  }
  void flip(uint64_t at) { flip_bits(path_, at, 4); }
  std::string expect_corrupt(const ClientResponse& answer) {
    if (answer.body.find(folder_.file("")) != std::string::npos) return "a path: " + answer.body;
    if (answer.body.find("voxdag verify") == std::string::npos) return "no advice: " + answer.body;
    if (answer.header("Cache-Control") != "no-store") return "it is cached";
    return Answers::not_problem(answer, 500, "corrupt");
  }
  size_t lines_of_log(const std::string& text) {
    const std::lock_guard lock(log_mutex_);
    size_t count = 0;
    for (size_t at = 0; (at = log_.find(text, at)) != std::string::npos; ++at) ++count;
    return count;
  }
  int port() const { return std::stoi(service_->url().substr(17)); }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("m.vdag");
  std::string digest_;
  std::optional<ViewService> service_;
  std::optional<HttpClient> http_;
  std::thread thread_;
  std::mutex log_mutex_;
  std::string log_;
};

// Requests for tiles in the damaged block are refused, and other tiles are sent. The log reports
// the damage once. When the block is repaired, its tiles are sent again.
TEST_F(HostileView, SeesThatAFileIsDamaged) {
  const auto file = open_global_file(path_);
  const uint32_t bricks = file->brick_level();
  ASSERT_GT(file->level(2).file_offset, 4096 + 65536u) << "the root tile lies in another block";
  uint64_t node = 0;
  for (uint32_t l = 0; l + 1 < bricks; ++l) node = file->node(l, node).child(0);
  const uint64_t brick =
      file->level(bricks).file_offset + 4 * file->node(bricks - 1, node).child(0);
  const std::string above = std::to_string(bricks - 1), offset = std::to_string(node);
  start();
  const std::string whole = get(above + "/" + offset).body;
  EXPECT_EQ(whole.substr(0, 4), "VDT1");
  flip(brick);
  EXPECT_EQ(expect_corrupt(get(above + "/" + offset)), "");
  EXPECT_EQ(expect_corrupt(get(above + "/" + offset)), "");
  EXPECT_EQ(expect_corrupt(get("batch?nodes=0.0," + above + "." + offset)), "");
  EXPECT_EQ(get("0/0").status, 200);
  EXPECT_EQ(lines_of_log(path_ + ": bytes "), 1u);
  flip(brick);
  EXPECT_TRUE(get(above + "/" + offset).body == whole);
}

// Requests for color pages of the damaged region are refused, and all other pages are sent.
TEST_F(HostileView, SeesThatColorsAreDamaged) {
  const uint64_t data = [&] {
    const auto file = open_global_file(path_);
    return static_cast<uint64_t>(file->colors().tier(0).data - file->data());
  }();
  start();
  std::vector<std::string> pages, whole;
  for (int i = 0; i < 512; ++i)
    pages.push_back("colors?pages=6." + std::to_string(i >> 6) + '.' + std::to_string(i >> 3 & 7) +
                    '.' + std::to_string(i & 7));
  for (const std::string& page : pages) whole.push_back(get(page).body);
  flip(data + 100000);  // this block has only color data, which is 240 KB long
  size_t refused = 0;
  for (size_t i = 0; i < pages.size(); ++i) {
    const ClientResponse answer = get(pages[i]);
    if (answer.status == 200) {
      EXPECT_TRUE(answer.body == whole[i]) << pages[i];
    } else {
      EXPECT_EQ(expect_corrupt(answer), "") << pages[i];
      ++refused;
    }
  }
  EXPECT_GT(refused, 0u);
  EXPECT_LT(refused, pages.size());
  EXPECT_EQ(lines_of_log(path_ + ": bytes "), 1u);
}

// The viewer refuses requests that a page of another site sends. A link from another site to the
// viewer's start page works.
TEST_F(HostileView, RefusesRequestsOfOtherSites) {
  start();
  const auto status = [&](const std::string& path, const std::string& site) {
    return http_->get(path, {{"Sec-Fetch-Site", site}}).status;
  };
  for (const char* path : {"/api/v1/view/tiles", "/%61pi/v1/view/tiles", "/api/none"})
    EXPECT_EQ(status(path, "cross-site"), 403) << path;
  for (const char* site : {"same-origin", "same-site", "none"})
    EXPECT_EQ(status("/api/v1/view/tiles", site), 200) << site;
  EXPECT_EQ(status("/", "cross-site"), 200);
  for (const char* path : {"/", "/api/v1/view/tiles", "/none"})
    EXPECT_EQ(http_->get(path).header("Cross-Origin-Resource-Policy"), "same-origin") << path;
}

// If clients disconnect, the service stops the work for them. It still answers other clients, and
// can be stopped.
TEST_F(HostileView, SurvivesClientsThatLeave) {
  start();
  std::string batch = "GET /api/v1/view/tiles/batch?v=" + digest_ + "&nodes=0.0";
  for (int i = 1; i < 64; ++i) batch += ",0.0";
  batch += " HTTP/1.1\r\nHost: localhost\r\n\r\n";
  for (int i = 0; i < 20; ++i) {
    const int socket = raw_connect(port());
    ASSERT_EQ(send(socket, batch.data(), batch.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(batch.size()));
    close(socket);
  }
  EXPECT_EQ(get("0/0").status, 200);
}

// Requests tiles of a finished job, with a limit of one permit: only one request for tiles may be
// in progress.
class TilePermits : public RunningService {
 protected:
  void SetUp() override {
    config_.transfers.max_per_client = config_.transfers.max_concurrent = 1;
    start();
    put_scene("m.glb", scene_bytes());
    const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
    ASSERT_TRUE(until_state(id, "succeeded"));
    base_ = "/api/v1/jobs/" + id + "/tiles";
    const Json manifest = Json::parse(http_->get(base_).body);
    version_ = "?v=" + manifest.value("digest", "");
  }
  std::string base_, version_;
};

// A request returns its permit however it ends, even if the client does not read the answer. So the
// next request can get it.
TEST_F(TilePermits, AreFreeWhenTheWorkIsDone) {
  const std::string tile = base_ + "/0/0" + version_;
  const std::string tag = http_->get(tile).header("ETag");
  const auto slow = [&](const std::string& path) {
    const int socket = raw_connect(std::stoi(url().substr(url().rfind(':') + 1)));
    const std::string text = "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n";
    EXPECT_EQ(send(socket, text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
    return socket;
  };
  // Repeats the request until it has the status, because a permit may be held for a moment after
  // the answer was sent. Until then the answer is "busy".
  const auto ends_with = [&](const std::string& path, int status,
                             const client::HeaderMap& headers = {}) {
    return until([&] { return http_->get(path, headers).status == status; });
  };
  std::vector<int> sockets;
  for (int i = 0; i < 3; ++i) {
    // With Connection: close, the server ends the connection after the answer. Otherwise
    // cpp-httplib would wait for a body, which an answer with status 304 does not have.
    EXPECT_TRUE(ends_with(tile, 304, {{"If-None-Match", tag}, {"Connection", "close"}}));
    EXPECT_TRUE(ends_with(base_ + "/0/1000000" + version_, 404));
    EXPECT_TRUE(ends_with(base_ + "/0/0?v=" + std::string(32, '0'), 410));
    EXPECT_TRUE(ends_with(base_ + "/batch" + version_ + "&nodes=x", 400));
    sockets.push_back(slow(tile));
    EXPECT_TRUE(ends_with(tile, 200));
  }
  for (const int socket : sockets) close(socket);
}

}  // namespace
}  // namespace voxdag::server
