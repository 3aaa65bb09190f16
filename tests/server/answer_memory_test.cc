// Tests that the memory of the service remains bounded while many clients do not read the largest
// answers.
#include <fcntl.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "core/base/clock.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxMemory = uint64_t{256} << 20;  // docs/operating.md
constexpr size_t kSlowReaders = 500;
constexpr double kMaxStartS = 600;

// `voxdag serve` as a separate process, whose memory is measured.
class AnswerMemory : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_.file("a.glb")) << "glTF";
    // No job starts, because no disk has the free space that this configuration requires.
    std::ofstream(folder_.file("config.json")) << Json{
        {"jobs", {{"min_free_disk", uint64_t{1} << 60}}}, {"scene_roots", {folder_.path()}}};
    const std::string log = folder_.file("log");
    pid_ = fork();
    if (pid_ == 0) {
      dup2(open(log.c_str(), O_WRONLY | O_CREAT, 0644), 2);
      execl(VOXDAG_BINARY, VOXDAG_BINARY, "serve", "--port", "0", "--data",
            folder_.file("data").c_str(), "--config", folder_.file("config.json").c_str(), nullptr);
      _exit(127);
    }
    const double deadline = wall_seconds() + kMaxStartS;
    for (std::string line; url_.empty() && wall_seconds() < deadline; usleep(10000)) {
      std::ifstream text(log);
      while (std::getline(text, line))
        if (const size_t at = line.find("http://"); at != std::string::npos) url_ = line.substr(at);
    }
    ASSERT_NE(url_, "");
    http_ = std::make_unique<HttpClient>(ClientOptions{url_, "", "", 300});
  }
  ~AnswerMemory() override {
    for (const int socket : sockets_) close(socket);
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }

  uint64_t resident_bytes() const {
    std::ifstream status("/proc/" + std::to_string(pid_) + "/statm");
    uint64_t size = 0, resident = 0;
    status >> size >> resident;
    return resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
  }
  // Posts a job with nearly the longest request that is allowed, so that answers about it are
  // large.
  void post_large_job() {
    const std::string folder = folder_.path() + "/";
    std::string path = folder;
    while (path.size() < 3800) path += "./";
    const Json body = {{"scene", std::vector<std::string>(8, path + "a.glb")}, {"resolution", 64}};
    const ClientResponse answer = http_->send("POST", "/api/v1/jobs", body.dump(), {});
    ASSERT_EQ(answer.status, 202) << answer.body;
  }
  // Requests `path` on a new connection, and does not read the answer.
  void ask_and_read_nothing(const std::string& path) {
    const int socket = raw_connect(std::stoi(url_.substr(url_.rfind(':') + 1)));
    const int small = 2048;
    setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    const std::string request = "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n";
    send(socket, request.data(), request.size(), MSG_NOSIGNAL);
    sockets_.push_back(socket);
  }

  TemporaryFolder folder_;
  pid_t pid_ = -1;
  std::string url_;
  std::unique_ptr<HttpClient> http_;
  std::vector<int> sockets_;
};

TEST_F(AnswerMemory, SlowReadersDoNotUseItUp) {
  for (int i = 0; i < 200; ++i) post_large_job();
  const uint64_t before = resident_bytes();
  const std::string list = "/api/v1/jobs?limit=200";
  EXPECT_GT(http_->get(list).body.size(), size_t{500} << 10) << "the answers are large";
  for (size_t i = 0; i < kSlowReaders; ++i) ask_and_read_nothing(list);
  uint64_t peak = 0;
  for (int i = 0; i < 100; ++i, usleep(100000)) peak = std::max(peak, resident_bytes());
  EXPECT_LT(peak, kMaxMemory);
  EXPECT_EQ(http_->get(list).status, 200) << "other clients are served";
  for (const int socket : sockets_) close(socket);
  sockets_.clear();
  uint64_t after = resident_bytes();
  for (int i = 0; i < 300 && after > before + (48 << 20); ++i, usleep(100000))
    after = resident_bytes();
  EXPECT_LE(after, before + (48 << 20)) << "memory returns to the system";
  RecordProperty("before_mib", static_cast<int>(before >> 20));
  RecordProperty("peak_mib", static_cast<int>(peak >> 20));
  std::printf("%d MiB before, %d MiB at peak, %d MiB after\n", static_cast<int>(before >> 20),
              static_cast<int>(peak >> 20), static_cast<int>(after >> 20));
}

// The list of 40 jobs with long requests is divided into pages of less than 700 KiB. Together they
// have every job once.
TEST_F(AnswerMemory, PagesOfLongJobsAreShort) {
  for (int i = 0; i < 40; ++i) post_large_job();
  std::string cursor;
  size_t jobs = 0, pages = 0;
  do {
    const ClientResponse answer = http_->get("/api/v1/jobs?limit=200" + cursor);
    ASSERT_EQ(answer.status, 200) << answer.body;
    EXPECT_LT(answer.body.size(), size_t{700} << 10);
    const Json page = Json::parse(answer.body);
    jobs += page["jobs"].size();
    ++pages;
    const Json& next = page["next_cursor"];
    cursor = next.is_string() ? "&cursor=" + next.get<std::string>() : "";
  } while (!cursor.empty() && pages < 100);
  EXPECT_EQ(jobs, 40u);
  EXPECT_EQ(pages, 3u);
}

}  // namespace
}  // namespace voxdag::server
