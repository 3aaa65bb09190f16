// Kills the service with SIGKILL at random moments. Every job still succeeds, with the bytes of
// `voxdag build`.
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <map>
#include <random>

#include "core/base/clock.h"
#include "core/format/checksum.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

constexpr double kMaxKillWaitS = 600;

// Returns the number of kills.
int rounds() {
  const char* text = std::getenv("VOXDAG_CRASH_ROUNDS");
  return text ? std::atoi(text) : 4;
}

class KilledService : public testing::Test {
 protected:
  ~KilledService() override { end(SIGKILL); }

  // Starts `voxdag serve` and waits until it listens.
  void start() {
    const std::string log = folder_.file("log");
    const size_t before = contents(log).size();
    pid_ = fork();
    if (pid_ == 0) {
      const int file = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
      dup2(file, 2);
      if (max_files_ > 0) {
        const rlimit limit{max_files_, max_files_};
        setrlimit(RLIMIT_NOFILE, &limit);
      }
      execl(VOXDAG_BINARY, VOXDAG_BINARY, "serve", "--port", "0", "--config",
            folder_.file("config.json").c_str(), nullptr);
      _exit(127);
    }
    const double deadline = wall_seconds() + kMaxKillWaitS;
    constexpr std::string_view kMark = "listening on ";
    for (;;) {
      const std::string text = contents(log).substr(before);
      const size_t at = text.find(kMark), end = text.find('\n', at);
      if (at != std::string::npos && end != std::string::npos) {
        const size_t begin = at + kMark.size();
        url_ = text.substr(begin, end - begin);
        http_ = std::make_unique<HttpClient>(ClientOptions{url_, "", "", 300});
        return;
      }
      ASSERT_LT(wall_seconds(), deadline) << text;
      usleep(2000);
    }
  }
  // Sends the signal to the service and waits for its end. Returns its exit status, or the negative
  // number of the signal that killed it.
  int end(int signal) {
    if (pid_ <= 0) return 0;
    kill(pid_, signal);
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  std::string contents(const std::string& path) {
    return system_files().exists(path) ? read_small_file(system_files(), path, 1 << 30) : "";
  }
  void run(const std::string& arguments) {
    const std::string command = std::string(VOXDAG_BINARY) + " " + arguments + " >/dev/null 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
  }
  void prepare() {
    run("generate soup " + folder_.file("s.glb") + " --triangles 30000");
    write_file_atomically(
        system_files(), folder_.file("config.json"),
        Json{{"data_folder", folder_.file("data")},
             {"jobs", {{"min_free_disk", 0}, {"memory", "256MiB"}, {"threads", 1}, {"nice", 0}}}}
            .dump());
    scene_ = contents(folder_.file("s.glb"));
    start();
    const ClientResponse put = http_->upload(
        "/api/v1/scenes/s.glb", scene_.size(),
        [&](uint64_t at, uint64_t max_bytes) { return scene_.substr(at, max_bytes); });
    ASSERT_EQ(put.status, 201) << put.body;
  }
  void post_jobs() {
    for (const int resolution : {512, 1024, 2048}) {
      const Json body = {{"scene", "s.glb"}, {"resolution", resolution}};
      const ClientResponse answer = http_->send("POST", "/api/v1/jobs", body.dump());
      ASSERT_EQ(answer.status, 202) << answer.body;
      jobs_.push_back({Json::parse(answer.body)["id"], resolution});
    }
  }
  std::string state(const std::string& id) {
    return Json::parse(http_->get("/api/v1/jobs/" + id).body).at("state");
  }

  struct Posted {
    std::string id;
    int resolution;
  };
  TemporaryFolder folder_;
  std::string scene_;
  std::vector<Posted> jobs_;
  std::string url_;
  std::unique_ptr<HttpClient> http_;
  pid_t pid_ = -1;
  rlim_t max_files_ = 0;  // limit for the service; 0: the limit of the test
};

TEST_F(KilledService, FinishesEveryJob) {
  prepare();
  post_jobs();
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> pause_us(0, 400'000);
  for (int round = 0; round < rounds(); ++round) {
    usleep(static_cast<useconds_t>(pause_us(random)));
    ASSERT_EQ(end(SIGKILL), -SIGKILL);
    start();
    if (state(jobs_.back().id) == "succeeded") post_jobs();  // each round must interrupt a job
  }
  std::map<int, std::string> expected;  // SHA-256 by resolution
  for (const auto& [id, resolution] : jobs_) {
    SCOPED_TRACE("resolution " + std::to_string(resolution));
    const double deadline = wall_seconds() + kMaxKillWaitS;
    while (state(id) != "succeeded" && state(id) != "failed" && wall_seconds() < deadline)
      usleep(20000);
    const Json job = Json::parse(http_->get("/api/v1/jobs/" + id).body);
    ASSERT_EQ(job["state"], "succeeded") << job.dump(2);
    EXPECT_EQ(job["attempts"], 1) << "a killed service is not a failed attempt";
    std::string& sha256 = expected[resolution];
    if (sha256.empty()) {
      const std::string local = folder_.file("local.vdag");
      run("build " + folder_.file("s.glb") + " -r " + std::to_string(resolution) + " -o " + local);
      sha256 = sha256_hex(contents(local));
    }
    EXPECT_EQ(job["result"]["sha256"], sha256);
    EXPECT_EQ(job["result"]["sha256"], sha256_hex(http_->get("/api/v1/jobs/" + id + "/dag").body));
  }
}

// After SIGTERM, builds stop at a checkpoint, and the service exits with status 0. The next service
// resumes the builds.
TEST_F(KilledService, DrainsAndResumes) {
  prepare();
  post_jobs();
  const std::string id = jobs_.back().id;
  const double deadline = wall_seconds() + kMaxKillWaitS;
  while (state(jobs_.front().id) == "queued" && wall_seconds() < deadline) usleep(2000);
  EXPECT_EQ(end(SIGTERM), 0);
  EXPECT_NE(contents(folder_.file("log")).find("stopped"), std::string::npos);
  start();
  while (state(id) != "succeeded" && state(id) != "failed" && wall_seconds() < deadline)
    usleep(20000);
  EXPECT_EQ(state(id), "succeeded");
  EXPECT_EQ(end(SIGTERM), 0);
}

// A service that can open only few files limits its connections, so that idle clients leave files
// for other clients and for jobs.
TEST_F(KilledService, FewOpenFilesLeaveConnections) {
  max_files_ = 64;
  prepare();
  EXPECT_NE(contents(folder_.file("log")).find("connections are limited to 32"), std::string::npos);
  const int port = std::stoi(url_.substr(url_.rfind(':') + 1));
  std::vector<int> slow;
  for (int i = 0; i < 100; ++i) {
    slow.push_back(raw_connect(port));
    const std::string begin = "GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: ";
    send(slow.back(), begin.data(), begin.size(), MSG_NOSIGNAL);
  }
  const double start = wall_seconds();
  for (int i = 0; i < 10; ++i)
    EXPECT_TRUE(raw_exchange(port, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
                    .starts_with("HTTP/1.1 200"));
  EXPECT_LT(wall_seconds() - start, 5) << "it does not wait for their time-outs";
  const ClientResponse posted =
      http_->send("POST", "/api/v1/jobs", Json{{"scene", "s.glb"}, {"resolution", 64}}.dump());
  ASSERT_EQ(posted.status, 202) << posted.body;
  const std::string id = Json::parse(posted.body)["id"];
  const double deadline = start + kMaxKillWaitS;
  while (state(id) != "succeeded" && state(id) != "failed" && wall_seconds() < deadline)
    usleep(20000);
  EXPECT_EQ(state(id), "succeeded");
  for (const int socket : slow) close(socket);
}

// Files in the data folder are accessible only to the service's user, whatever the umask of the
// service is.
TEST_F(KilledService, DataIsForTheServiceAlone) {
  prepare();
  const ClientResponse posted =
      http_->send("POST", "/api/v1/jobs", Json{{"scene", "s.glb"}, {"resolution", 64}}.dump());
  ASSERT_EQ(posted.status, 202) << posted.body;
  const std::string id = Json::parse(posted.body)["id"];
  const double deadline = wall_seconds() + kMaxKillWaitS;
  while (state(id) != "succeeded" && wall_seconds() < deadline) usleep(20000);
  namespace fs = std::filesystem;
  constexpr fs::perms kOfOthers = fs::perms::group_all | fs::perms::others_all;
  int files = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder_.file("data"))) {
    EXPECT_EQ(entry.status().permissions() & kOfOthers, fs::perms::none) << entry.path();
    files += entry.is_regular_file();
  }
  EXPECT_GT(files, 5);
}

}  // namespace
}  // namespace voxdag::server
