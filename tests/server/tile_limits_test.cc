// Tests the limits for requests of tiles: the number of permits, the size of a tile, and requests
// during which the file changes.
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <optional>
#include <thread>

#include "core/format/global/open_global.h"
#include "core/io/forwarding_files.h"
#include "query/tiles/tile.h"
#include "server/api/access/tokens.h"
#include "server/view_service.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

// Returns the maximum size in bytes of a tile with this number of levels: all eight children exist
// at every node (docs/format.md).
uint64_t bytes_of_fullest_tile(uint32_t levels) {
  uint64_t nodes = 0, of_level = 1;
  for (uint32_t l = 0; l < levels; ++l, of_level *= 8) nodes += of_level;
  return 4 * (4 + 9 * nodes + 4 * of_level);
}

// Returns the path of a batch that requests the root's tile 64 times.
std::string largest_batch(const std::string& version) {
  std::string path = "/batch" + version + "&nodes=0.0";
  for (int i = 1; i < 64; ++i) path += ",0.0";
  return path;
}

// Writes a scene whose DAG has the largest possible root tile: all cubes of level 3 have voxels,
// and no two of them are equal.
void make_soup(const std::string& path) {
  const std::string command = std::string(VOXDAG_BINARY) + " generate soup " + path +
                              " --triangles 200000 --force >/dev/null 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0);
}

// A service in which each client may have one tile request in progress, and all clients together
// may have two.
class TileLimits : public RunningService {
 protected:
  void SetUp() override {
    std::string lines;
    for (const char* name : {"anna", "ben", "carol"}) {
      const NewToken made = make_token("admin", name);
      lines += made.line + "\n";
      tokens_[name] = made.token;
    }
    write_file_atomically(system_files(), folder_.file("tokens"), lines);
    config_.token_file = folder_.file("tokens");
    config_.transfers.max_per_client = 1;
    config_.transfers.max_concurrent = 2;
    start();
    http_ = std::make_unique<HttpClient>(ClientOptions{url(), tokens_["anna"], "", 300});
    make_soup(folder_.file("soup.glb"));
    put_scene("soup.glb", read_small_file(system_files(), folder_.file("soup.glb"), 1 << 30));
    const std::string id = post_job({{"scene", "soup.glb"}, {"resolution", 256}});
    ASSERT_TRUE(until_state(id, "succeeded"));
    base_ = "/api/v1/jobs/" + id + "/tiles";
    version_ = "?v=" + Json::parse(get("anna", "").body).value("digest", "");
  }
  ClientResponse get(const std::string& name, const std::string& path) {
    HttpClient client(ClientOptions{url(), tokens_[name], "", 300});
    return client.get(base_ + path);
  }
  // Requests the largest batch and reads only the first bytes of its answer, so that the request
  // continues to hold a permit. Returns the socket.
  int ask_and_read_nothing(const std::string& name) {
    const std::string text = "GET " + base_ + largest_batch(version_) +
                             " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" +
                             "Authorization: Bearer " + tokens_[name] + "\r\n\r\n";
    // Repeats the request while it is refused, because an earlier request may hold its permit for a
    // moment after its answer.
    for (;;) {
      const int socket = raw_connect(std::stoi(url().substr(url().rfind(':') + 1)));
      EXPECT_EQ(send(socket, text.data(), text.size(), MSG_NOSIGNAL),
                static_cast<ssize_t>(text.size()));
      std::string begin(12, '\0');
      const ssize_t got = recv(socket, begin.data(), begin.size(), MSG_PEEK | MSG_WAITALL);
      if (begin == "HTTP/1.1 200") return socket;
      close(socket);
      EXPECT_TRUE(got == 12 && begin == "HTTP/1.1 503") << begin;
      if (HasFailure()) return -1;
    }
  }
  // Returns "" if the answer reports that no permit was free; otherwise a description of the
  // answer.
  static std::string not_busy(const ClientResponse& answer) {
    if (answer.status == 503 && answer.header("Retry-After") != "1") return "no Retry-After";
    if (answer.status == 503 && answer.header("Cache-Control") != "no-store") return "it is cached";
    return not_problem(answer, 503, "busy");
  }

  std::map<std::string, std::string> tokens_;
  std::string base_, version_;
};

// A client that does not read a large answer blocks only its own requests for tiles, until it
// disconnects. Other clients are answered while permits are left.
TEST_F(TileLimits, ASlowReaderBlocksItselfAlone) {
  const std::string tile = "/0/0" + version_;
  const int anna = ask_and_read_nothing("anna");
  for (const std::string& path : {tile, std::string(), largest_batch(version_)}) {
    EXPECT_EQ(not_busy(get("anna", path)), "") << path;
    EXPECT_EQ(get("ben", path).status, 200) << path;
  }
  EXPECT_EQ(http_->get(base_.substr(0, base_.rfind('/'))).status, 200) << "other routes";
  const int ben = ask_and_read_nothing("ben");
  EXPECT_EQ(not_busy(get("ben", tile)), "");
  EXPECT_EQ(not_busy(get("carol", tile)), "") << "the limit of all";
  close(anna);
  EXPECT_TRUE(until([&] { return get("anna", tile).status == 200; }));
  EXPECT_EQ(get("carol", tile).status, 200);
  EXPECT_EQ(not_busy(get("ben", tile)), "");
  close(ben);
}

// A slow client that continues to read gets the complete answer.
TEST_F(TileLimits, ASlowReaderGetsItsAnswer) {
  const std::string whole = get("ben", largest_batch(version_)).body;
  EXPECT_GE(whole.size(), size_t{512} << 10) << "a small answer holds no permit";
  const int anna = ask_and_read_nothing("anna");
  std::string answer;
  std::vector<char> piece(1 << 16);
  for (ssize_t got; (got = recv(anna, piece.data(), piece.size(), 0)) > 0;)
    answer.append(piece.data(), static_cast<size_t>(got));
  close(anna);
  EXPECT_TRUE(answer.substr(answer.find("\r\n\r\n") + 4) == whole);
}

// A root tile with all eight children at every node has exactly the maximum size of docs/format.md.
TEST_F(TileLimits, TilesAreNoLargerThanDocumented) {
  const Json manifest = Json::parse(get("anna", "").body);
  const uint32_t levels = manifest["tile_levels"];
  const uint64_t most = bytes_of_fullest_tile(levels);
  EXPECT_EQ(most, 10836u) << "docs/format.md says so";
  const ClientResponse tile = get("anna", "/0/0" + version_);
  ASSERT_EQ(manifest["levels"].get<uint32_t>() % levels, 2u) << "no tile at the root is cut off";
  EXPECT_EQ(tile.body.size(), most);
  EXPECT_EQ(get("anna", largest_batch(version_)).body.size(), 64 * (4 + most));
  const auto file = open_global_file(config_.data_folder + "/jobs/" +
                                     base_.substr(13, base_.rfind('/') - 13) + "/result.vdag");
  const query::DagView dag(*file);
  EXPECT_LE(bytes_of_fullest_tile(query::kMaxTileLevels), uint64_t{700} << 10) << "query/tiles";
  for (uint32_t depth = 1; depth <= query::kMaxTileLevels; ++depth)
    EXPECT_LE(query::encode_tile(dag, depth, {0, 0}).size() * 4, bytes_of_fullest_tile(depth));
}

// While `changes` is true, changes the file of `voxdag view` each time the service reads its
// identity (its times and size).
class ChangingFiles : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  std::atomic<bool> changes{false};

 private:
  std::unique_ptr<ReadableFile> reader_of(std::unique_ptr<ReadableFile> file) override {
    return std::make_unique<Reader>(std::move(file), changes);
  }

  class Reader : public ForwardingReader {
   public:
    Reader(std::unique_ptr<ReadableFile> file, const std::atomic<bool>& changes)
        : ForwardingReader(std::move(file)), changes_(changes) {}
    FileIdentity identity() const override {
      const FileIdentity before = ForwardingReader::identity();
      // Changes the file's modification time, as a write does. Repeats this until the time differs,
      // because times may be coarse.
      while (changes_ && system_files().open_read(path())->identity() == before)
        system_files().touch(path());
      return before;
    }

   private:
    const std::atomic<bool>& changes_;
  };
};

// While another program writes the file, tiles could mix old and new contents. So the service
// answers with the error `gone`, which no browser may store. After the last write, requests succeed
// again.
TEST(OverwrittenFile, IsGoneWhileItsTilesAreMade) {
  const TemporaryFolder folder;
  const std::string path = folder.file("m.vdag"), scene = folder.file("m.glb");
  const std::string program = VOXDAG_BINARY;
  ASSERT_EQ(
      std::system((program + " generate menger " + scene + " --level 1 >/dev/null 2>&1 && " +
                   program + " build " + scene + " -r 64 --color -o " + path + " >/dev/null 2>&1")
                      .c_str()),
      0);
  ChangingFiles files(system_files());
  ViewService service(path, 0, files, [](const LogEntry&) {});
  std::thread thread([&] { service.run(); });
  {
    HttpClient http(ClientOptions{service.url().substr(0, service.url().size() - 1), "", "", 60});
    const std::string base = "/api/v1/view/tiles";
    const std::string digest = Json::parse(http.get(base).body)["digest"];
    const std::string version = "?v=" + digest;
    const std::vector<std::string> paths = {base, base + "/0/0" + version,
                                            base + "/batch" + version + "&nodes=0.0,0.0",
                                            base + "/colors" + version + "&pages=6.0.7.1"};
    for (const std::string& each : paths) EXPECT_EQ(http.get(each).status, 200) << each;
    files.changes = true;
    struct Answers : RunningService {
      using RunningService::not_problem;
    };
    for (const std::string& each : paths) {
      const ClientResponse answer = http.get(each);
      EXPECT_EQ(Answers::not_problem(answer, 410, "gone"), "") << each;
      EXPECT_EQ(answer.header("Cache-Control"), "no-store") << each;
    }
    files.changes = false;
    for (const std::string& each : paths) EXPECT_EQ(http.get(each).status, 200) << each;
  }
  service.stop();
  thread.join();
}

}  // namespace
}  // namespace voxdag::server
