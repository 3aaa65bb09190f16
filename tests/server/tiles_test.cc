// Requests the tiles of jobs' results and of `voxdag view` as viewers do.
#include <zlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

#include "core/format/global/open_global.h"
#include "query/tiles/color_page.h"
#include "query/tiles/tile.h"
#include "server/api/access/tokens.h"
#include "server/view_service.h"
#include "tests/server/running_service.h"
#include "tests/support/flip_bits.h"

namespace voxdag::server {
namespace {

// Returns the bytes of a tile of the file: little-endian words.
std::string tile_bytes(const std::string& path, uint32_t tile_levels, uint32_t level,
                       uint64_t offset) {
  const auto file = open_global_file(path);
  const auto words = query::encode_tile(query::DagView(*file), tile_levels, {level, offset});
  return {reinterpret_cast<const char*>(words.data()), words.size() * 4};
}

std::string with_length(const std::string& tile) {
  std::string bytes;
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(tile.size() >> shift);
  return bytes + tile;
}

std::string inflated(const std::string& packed) {
  std::string out(1 << 22, '\0');
  z_stream stream{};
  EXPECT_EQ(inflateInit2(&stream, 31), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

// True if this process has mapped the file.
bool is_mapped(const std::string& path) {
  std::ifstream maps("/proc/self/maps");
  const std::string text{std::istreambuf_iterator<char>(maps), {}};
  return text.find(path) != std::string::npos;
}

class Tiles : public RunningService {
 protected:
  // Starts the service and runs one job to its end.
  void finish_job() {
    start();
    put_scene("m.glb", scene_bytes());
    id_ = post_job({{"scene", "m.glb"}, {"resolution", 256}});
    ASSERT_TRUE(until_state(id_, "succeeded"));
    base_ = "/api/v1/jobs/" + id_ + "/tiles";
    result_ = config_.data_folder + "/jobs/" + id_ + "/result.vdag";
    manifest_ = Json::parse(http_->get(base_).body);
    version_ = "?v=" + manifest_.value("digest", "");
    levels_ = manifest_.value("tile_levels", 0u);
  }
  std::string error(const std::string& path, int status, const std::string& code) {
    return not_problem(http_->get(base_ + path), status, code);
  }

  std::string id_, base_, result_, version_;
  Json manifest_;
  uint32_t levels_ = 0;
};

// Clients have no file, so the advice is not a command that needs one.
TEST_F(Tiles, OfADamagedResultAdviseANewJob) {
  finish_job();
  stop();
  const auto file = open_global_file(result_);
  const uint32_t bricks = file->brick_level();
  uint64_t node = 0;
  for (uint32_t l = 0; l + 1 < bricks; ++l) node = file->node(l, node).child(0);
  flip_bits(result_, file->level(bricks).file_offset + 4 * file->node(bricks - 1, node).child(0),
            4);
  start();
  const ClientResponse answer =
      http_->get(base_ + "/" + std::to_string(bricks - 1) + "/" + std::to_string(node) + version_);
  EXPECT_EQ(not_problem(answer, 500, "corrupt"), "");
  EXPECT_NE(answer.body.find("is damaged: submit a new job of the scene"), std::string::npos)
      << answer.body;
  EXPECT_EQ(answer.body.find("voxdag verify"), std::string::npos) << answer.body;
}

TEST_F(Tiles, HaveAManifest) {
  finish_job();
  EXPECT_EQ(manifest_["resolution"], 256);
  EXPECT_EQ(manifest_["levels"], 8);
  EXPECT_EQ(manifest_["root"], (Json{{"level", 0}, {"offset", 0}}));
  EXPECT_EQ(manifest_["batch_max"], 64);
  EXPECT_EQ(manifest_["voxels"], std::to_string(job(id_)["result"]["voxels"].get<uint64_t>()));
  EXPECT_EQ(manifest_["digest"].get<std::string>().size(), 32u);
  EXPECT_TRUE(levels_ >= 1 && levels_ <= query::kMaxTileLevels);
  for (const char* view : {"iso", "front", "top"})
    for (const char* shape : {"views", "tall_views"})
      EXPECT_EQ(manifest_[shape][view]["position"].size(), 3u) << view;
  EXPECT_GT(manifest_["camera"]["fov_degrees"], 0);
  for (size_t axis = 0; axis < 3; ++axis) {
    const double low = manifest_["box"]["low"][axis], high = manifest_["box"]["high"][axis];
    EXPECT_TRUE(0 <= low && low < high && high <= 256) << low << ' ' << high;
  }
  EXPECT_EQ(http_->get(base_).header("Cache-Control"), "no-store");
}

// The contents of a URL with a digest never change. If a client already has them, it gets the
// status 304 without the contents.
TEST_F(Tiles, AreSentOnce) {
  finish_job();
  const std::string path = base_ + "/0/0" + version_, root = tile_bytes(result_, levels_, 0, 0);
  const ClientResponse tile = http_->get(path);
  EXPECT_EQ(tile.status, 200);
  EXPECT_TRUE(tile.body == root);
  EXPECT_EQ(tile.header("Content-Type"), "application/octet-stream");
  EXPECT_EQ(tile.header("Cache-Control"), "private, max-age=31536000, immutable");
  const ClientResponse head = http_->head(path);
  EXPECT_EQ(head.header("Content-Length"), std::to_string(root.size()));
  EXPECT_TRUE(head.body.empty());
  const client::HeaderMap known = {{"If-None-Match", tile.header("ETag")}, {"Connection", "close"}};
  EXPECT_EQ(http_->get(path, known).status, 304);
  EXPECT_EQ(http_->get(base_ + "/batch" + version_ + "&nodes=0.0", known).status, 200);
}

TEST_F(Tiles, AreCompressedForClientsThatAcceptIt) {
  finish_job();
  const std::string path = base_ + "/0/0" + version_;
  const auto packed_for = [&](const std::string& accepted) {
    const ClientResponse answer = http_->stream(
        path, {{"Accept-Encoding", accepted}, {"Connection", "close"}},
        [](const ClientResponse&) { return true; }, [](std::string_view) { return true; });
    return answer.header("Content-Encoding") == "gzip";
  };
  for (const char* accepted : {"gzip", "br, GZIP;q=0.5", "*"}) EXPECT_TRUE(packed_for(accepted));
  for (const char* accepted : {"", "br", "gzip;q=0", "*, gzip; q=0.0", "identity"})
    EXPECT_FALSE(packed_for(accepted)) << accepted;
  const int port = std::stoi(url().substr(url().rfind(':') + 1));
  const std::string answer =
      raw_exchange(port, "GET " + path +
                             " HTTP/1.1\r\nHost: localhost\r\nAccept-Encoding: gzip\r\n"
                             "Connection: close\r\n\r\n");
  const std::string packed = answer.substr(answer.find("\r\n\r\n") + 4), whole = inflated(packed);
  EXPECT_TRUE(whole == tile_bytes(result_, levels_, 0, 0));
  EXPECT_LT(packed.size(), whole.size());
}

// The answer to a batch has all requested tiles in the requested order, or is an error.
TEST_F(Tiles, ComeInBatches) {
  finish_job();
  const auto file = open_global_file(result_);
  const uint64_t child = file->node(0, 0).child(0), grandchild = file->node(1, child).child(0);
  const std::string names = "2." + std::to_string(grandchild) + ",0.0,1." + std::to_string(child);
  const std::string expected = with_length(tile_bytes(result_, levels_, 2, grandchild)) +
                               with_length(tile_bytes(result_, levels_, 0, 0)) +
                               with_length(tile_bytes(result_, levels_, 1, child));
  EXPECT_TRUE(http_->get(base_ + "/batch" + version_ + "&nodes=" + names).body == expected);
  std::string many = "0.0";
  for (int i = 1; i < 64; ++i) many += ",0.0";
  EXPECT_EQ(http_->get(base_ + "/batch" + version_ + "&nodes=" + many).status, 200);
  const auto refused = [&](const std::string& nodes) {
    return error("/batch" + version_ + "&nodes=" + nodes, 400, "invalid_input");
  };
  for (const std::string& nodes :
       {many + ",0.0", std::string(), std::string("0.0,"), std::string(",0.0"), std::string("0"),
        std::string("0.0.0"), std::string("a.b"), std::string("-1.0"), std::string("4294967296.0")})
    EXPECT_EQ(refused(nodes), "") << nodes;
  EXPECT_EQ(error("/batch" + version_ + "&nodes=0.0,0.1", 404, "not_found"), "");
}

TEST_F(Tiles, OfWhatIsNotThereAreRefused) {
  finish_job();
  // Level 6 has the bricks.
  for (const char* path :
       {"/6/0", "/0/1", "/0/9", "/18/0", "/0/1099511627776", "/4294967295/0", "/4294967296/0",
        "/0/-1", "/x/0", "/0/18446744073709551615", "/0/18446744073709551616", "/0/0x"})
    EXPECT_EQ(error(path + version_, 404, "not_found"), "") << path;
  EXPECT_EQ(error("/0/0", 400, "invalid_input"), "");
  EXPECT_EQ(error("/0/0?v=null", 400, "invalid_input"), "");
  const std::string other(32, '0');
  EXPECT_EQ(error("/0/0?v=" + other, 410, "gone"), "");
  EXPECT_EQ(error("/batch?v=" + other + "&nodes=0.0", 410, "gone"), "");
  EXPECT_EQ(error("/0/0" + version_ + "&depth=2", 400, "invalid_input"), "");
  EXPECT_EQ(not_problem(http_->get("/api/v1/jobs/none/tiles"), 404, "not_found"), "");
  const std::string unfinished = post_job({{"scene", "m.glb"}, {"resolution", 16384}});
  for (const char* path : {"/tiles", "/tiles/0/0?v=1", "/tiles/batch?v=1&nodes=0.0",
                           "/tiles/colors?v=1&pages=0.0.0.0"}) {
    const ClientResponse early = http_->get("/api/v1/jobs/" + unfinished + path);
    EXPECT_EQ(not_problem(early, 409, "conflict"), "") << path;
    EXPECT_TRUE(Json::parse(early.body).contains("state"));
  }
  post("/api/v1/jobs/" + unfinished + "/cancel");
}

// When a job is deleted, the service closes its result, because an open file keeps its disk space.
TEST_F(Tiles, OfADeletedJobAreClosed) {
  finish_job();
  EXPECT_EQ(http_->get(base_ + "/0/0" + version_).status, 200);
  EXPECT_TRUE(is_mapped(id_));
  EXPECT_EQ(http_->send("DELETE", "/api/v1/jobs/" + id_, "").status, 204);
  EXPECT_FALSE(is_mapped(id_));
  EXPECT_EQ(error("/0/0" + version_, 404, "not_found"), "");
}

TEST_F(Tiles, NeedTheRoleRead) {
  const NewToken reader = make_token("read", "r");
  write_file_atomically(system_files(), folder_.file("tokens"), reader.line + "\n");
  config_.token_file = folder_.file("tokens");
  start();
  HttpClient client({url(), reader.token, "", 60});
  for (const char* path : {"/tiles", "/tiles/0/0?v=1", "/tiles/batch?v=1&nodes=0.0",
                           "/tiles/colors?v=1&pages=0.0.0.0", "/partial"}) {
    const std::string url = std::string("/api/v1/jobs/none") + path;
    EXPECT_EQ(not_problem(http_->get(url), 401, "unauthorized"), "") << path;
    EXPECT_EQ(not_problem(client.get(url), 404, "not_found"), "") << path;
  }
}

// While a job runs, /partial serves the subvolumes that are built. After the job has succeeded,
// there is no partial view.
TEST_F(Tiles, OfARunningJobAreItsSubvolumes) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"},
                                   {"resolution", 65536},
                                   {"options", {{"subvolume", 2048}, {"threads", 1}}}});
  const std::string path = "/api/v1/jobs/" + id + "/partial";
  Json view;
  ASSERT_TRUE(until([&] {
    const bool is_planned = http_->get("/api/v1/jobs/" + id + "/subvolumes").status == 200;
    const ClientResponse answer = http_->get(path);
    EXPECT_TRUE(answer.status == 200 || !is_planned) << answer.body;
    EXPECT_TRUE(answer.status == 200 || not_problem(answer, 404, "not_found").empty())
        << answer.body << log();
    view = Json::parse(answer.body);
    return answer.status == 200 && !view["cubes"].empty();
  }));
  EXPECT_EQ(view["resolution"], 65536);
  EXPECT_LE(view["cubes"].size(), view["built"].get<size_t>());
  EXPECT_LT(view["built"], view["total"]);
  for (const Json& cube : view["cubes"]) {
    ASSERT_EQ(cube.size(), 6u);
    EXPECT_EQ(cube[3], 2048);
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(cube[axis].get<int>() % 2048, 0);
    EXPECT_GT(cube[4].get<uint64_t>() + cube[5].get<uint64_t>(), 0u);
  }
  // The built part is also available as a DAG in tiles.
  const std::string base = path + "/tiles";
  Json m;
  ASSERT_TRUE(until([&] {
    m = Json::parse(http_->get(base).body);
    return m.contains("root") && m["root"].is_object();
  })) << m;
  EXPECT_EQ(m["resolution"], 65536);
  EXPECT_LT(m["built"], m["total"]);
  EXPECT_EQ(m["camera"]["position"].size(), 3u);
  const std::string version = "?v=" + m["digest"].get<std::string>();
  const std::string root = std::to_string(m["root"]["offset"].get<uint64_t>());
  const ClientResponse tile = http_->get(base + "/0/" + root + version);
  EXPECT_EQ(tile.body.substr(0, 4), "VDT1");
  EXPECT_EQ(tile.header("Cache-Control"), "private, max-age=31536000, immutable");
  EXPECT_EQ(http_->get(base + "/batch" + version + "&nodes=0." + root).body,
            with_length(tile.body));
  EXPECT_EQ(not_problem(http_->get(base + "/0/0?v=" + std::string(32, '0')), 410, "gone"), "");
  const ClientResponse colors = http_->get(base + "/colors" + version + "&pages=0.0.0.0");
  EXPECT_EQ(not_problem(colors, 404, "not_found"), "");
  post("/api/v1/jobs/" + id + "/cancel");
  const std::string done = post_job({{"scene", "m.glb"}, {"resolution", 64}});
  ASSERT_TRUE(until_state(done, "succeeded"));
  for (const char* more : {"", "/tiles", "/tiles/0/0?v=1"}) {
    const std::string url = "/api/v1/jobs/" + done + "/partial" + more;
    EXPECT_EQ(not_problem(http_->get(url), 404, "not_found"), "") << url;
  }
}

struct Answers : RunningService {
  using RunningService::not_problem;
};

// Serves one file, as `voxdag view` does.
class View : public testing::Test {
 protected:
  ~View() override {
    if (service_) service_->stop();
    if (thread_.joinable()) thread_.join();
  }
  void build(const std::string& resolution, const std::string& more = "") {
    const std::string program = VOXDAG_BINARY, scene = folder_.file("m.glb");
    const std::string command = program + " generate menger " + scene +
                                " --level 1 --force >/dev/null 2>&1 && " + program + " build " +
                                scene + " -r " + resolution + " -o " + path_ + " --force " + more +
                                " >/dev/null 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0);
  }
  void start() {
    service_.emplace(path_, 0, system_files(), [](const LogEntry&) {});
    thread_ = std::thread([this] { service_->run(); });
    const std::string url = service_->url();
    http_.emplace(ClientOptions{url.substr(0, url.size() - 1), "", "", 60});
  }
  Json manifest() { return Json::parse(http_->get("/api/v1/view/tiles").body); }
  int status(const std::string& path, const std::string& digest) {
    return http_->get("/api/v1/view/tiles/" + path + "?v=" + digest).status;
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("m.vdag");
  std::optional<ViewService> service_;
  std::optional<HttpClient> http_;
  std::thread thread_;
};

TEST_F(View, ServesTheFileAndTheAssets) {
  build("64");
  start();
  const Json m = manifest();
  const ClientResponse tile =
      http_->get("/api/v1/view/tiles/0/0?v=" + m["digest"].get<std::string>());
  EXPECT_TRUE(tile.body == tile_bytes(path_, m["tile_levels"], 0, 0));
  EXPECT_EQ(m["name"], "m.vdag");
  const auto has = [&](const std::string& path, const char* sources) {
    return http_->get(path).header("Content-Security-Policy").find(sources) != std::string::npos;
  };
  EXPECT_TRUE(has("/", "frame-ancestors 'none'"));
  EXPECT_TRUE(has("/?embed", "frame-ancestors http://localhost:*"));
  EXPECT_EQ(http_->get("/lib/dom.js").header("Content-Type"), "text/javascript; charset=utf-8");
  EXPECT_EQ(http_->get("/api/v1/jobs").status, 404);
  EXPECT_EQ(http_->send("POST", "/api/v1/view/tiles", "{}").status, 405);
  // A page of another site can resolve its host name to this machine and send requests to this
  // port. The Host field then has the page's name, so such requests are refused.
  EXPECT_EQ(http_->get("/api/v1/view/tiles", {{"Host", "evil.example"}}).status, 403);
}

// If the file was replaced, the service refuses requests with the old digest.
TEST_F(View, NoticesThatTheFileWasReplaced) {
  build("64");
  start();
  const std::string old = manifest()["digest"];
  EXPECT_EQ(status("0/0", old), 200);
  build("128");
  EXPECT_EQ(status("0/0", old), 410);
  const Json m = manifest();
  EXPECT_EQ(m["resolution"], 128);
  EXPECT_EQ(status("0/0", m["digest"]), 200);
  std::filesystem::remove(path_);
  EXPECT_EQ(status("0/0", m["digest"]), 404);
}

// The file is truncated between the check of its identity and the read of its nodes. The read does
// not crash, and the next check reports an error.
TEST_F(View, ATruncatedFileIsAnErrorAndNoCrash) {
  build("64");
  const FileTileSource file(path_, system_files().open_read(path_)->identity());
  EXPECT_NO_THROW(file.expect_readable());
  std::filesystem::resize_file(path_, 4096);
  try {
    query::encode_tile(file.dag(), kTileLevels, {0, 0});
  } catch (const Error&) {
    // This error can occur. Otherwise encode_tile() has made a tile from the zeros that replace the
    // missing bytes.
  }
  EXPECT_THROW(file.expect_readable(), Error);
}

// The file is truncated after it was mapped, so that its header or its tables are missing. Opening
// it is an error, not a crash.
TEST_F(View, AFileThatIsTruncatedWhileItIsOpenedIsAnErrorAndNoCrash) {
  build("64");
  const FileIdentity identity = system_files().open_read(path_)->identity();
  const auto size = std::filesystem::file_size(path_);
  for (const uint64_t left : {uint64_t{0}, uint64_t{4096}, size / 4096 * 4096 - 4096}) {
    SCOPED_TRACE(left);
    build("64");
    const auto bytes = map_global_file(path_);
    std::filesystem::resize_file(path_, left);
    try {
      const FileTileSource file(path_, identity, bytes);
      FAIL() << "the file is opened";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kIo) << error.message();
    }
  }
}

// A color page has the colors of up to 8 x 8 x 8 cells. Requested pages equal the pages that
// ColorPages encodes. Invalid addresses and absent pages are refused.
TEST_F(View, SendsColorPages) {
  build("64", "--color");
  start();
  const Json m = manifest();
  EXPECT_EQ(m["colors"], (Json{{"levels", 6}, {"batch_max", 256}}));
  const std::string version = "/api/v1/view/tiles/colors?v=" + m["digest"].get<std::string>();
  const std::string batch = version + "&pages=";
  const auto file = open_global_file(path_);
  const query::DagView dag(*file);
  query::ColorPages pages(*file, dag);
  std::string expected;
  for (const query::ColorPageAddress& address :
       {query::ColorPageAddress{6, {0, 7, 1}}, {0, {0, 0, 0}}, {4, {1, 1, 0}}}) {
    const std::vector<uint32_t> words = pages.encode(address);
    EXPECT_GT(words.size(), 1u);
    expected += with_length({reinterpret_cast<const char*>(words.data()), words.size() * 4});
  }
  const ClientResponse answer = http_->get(batch + "6.0.7.1,0.0.0.0,4.1.1.0");
  EXPECT_TRUE(answer.body == expected);
  EXPECT_EQ(answer.header("Cache-Control"), "private, max-age=31536000, immutable");
  EXPECT_EQ(http_
                ->get(batch + "6.0.7.1,0.0.0.0,4.1.1.0",
                      {{"If-None-Match", answer.header("ETag")}, {"Connection", "close"}})
                .status,
            304);
  std::string many = "6.0.0.0";
  for (int i = 1; i < 256; ++i) many += ",6.0.0.0";
  EXPECT_EQ(http_->get(batch + many).status, 200);
  for (const std::string& list :
       {many + ",6.0.0.0", std::string(), std::string("6.0.0.0,"), std::string(",6.0.0.0"),
        std::string("6.0.0"), std::string("6.0.0.0.0"), std::string("6.0.-1.0"),
        std::string("x.0.0.0"), std::string("21.0.0.0"), std::string("4294967302.0.0.0"),
        std::string("6.131072.0.0"), std::string("6.0.0.18446744073709551616")})
    EXPECT_EQ(Answers::not_problem(http_->get(batch + list), 400, "invalid_input"), "") << list;
  for (const char* list : {"6.8.0.0", "7.0.0.0", "20.0.0.0", "2.0.0.1", "6.0.0.0,6.0.131071.0"})
    EXPECT_EQ(Answers::not_problem(http_->get(batch + list), 404, "not_found"), "") << list;
  EXPECT_EQ(Answers::not_problem(http_->get(version), 400, "invalid_input"), "");
  EXPECT_EQ(Answers::not_problem(http_->get("/api/v1/view/tiles/colors?v=" + std::string(32, '0') +
                                            "&pages=6.0.0.0"),
                                 410, "gone"),
            "");
  build("64");
  const Json gray = manifest();
  EXPECT_FALSE(gray.contains("colors"));
  EXPECT_NE(gray["digest"], m["digest"]);
  const ClientResponse none = http_->get(
      "/api/v1/view/tiles/colors?v=" + gray["digest"].get<std::string>() + "&pages=0.0.0.0");
  EXPECT_EQ(Answers::not_problem(none, 404, "not_found"), "");
  EXPECT_NE(none.body.find("no colors"), std::string::npos) << none.body;
}

TEST_F(View, ShowsASingleBrickAndAnEmptyScene) {
  build("4");
  start();
  Json m = manifest();
  const uint64_t mask = open_global_file(path_)->brick(0);
  EXPECT_EQ(m["root_brick"],
            (Json{static_cast<uint32_t>(mask), static_cast<uint32_t>(mask >> 32)}));
  EXPECT_EQ(status("0/0", m["digest"]), 404);
  build("64", "--bounds 100,100,100,1 --allow-empty");
  m = manifest();
  EXPECT_TRUE(m["root"].is_null()) << m;
  EXPECT_EQ(m["voxels"], "0");
  EXPECT_FALSE(m.contains("camera"));
  EXPECT_EQ(status("0/0", m["digest"]), 404);
}

TEST(OpenTileSources, AreFew) {
  TemporaryFolder folder;
  const std::string scene = folder.file("m.glb"), program = VOXDAG_BINARY;
  ASSERT_EQ(
      std::system((program + " generate menger " + scene + " --level 1 >/dev/null 2>&1").c_str()),
      0);
  std::vector<std::string> paths;
  for (const char* name : {"a.vdag", "b.vdag", "c.vdag"}) {
    paths.push_back(folder.file(name));
    ASSERT_EQ(
        std::system((program + " build " + scene + " -r 16 -o " + paths.back() + " >/dev/null 2>&1")
                        .c_str()),
        0);
  }
  OpenTileSources files(system_files(), 2);
  const auto first = files.open(paths[0]);
  EXPECT_EQ(files.open(paths[0]), first);
  files.open(paths[1]);
  files.open(paths[0]);
  files.open(paths[2]);
  EXPECT_EQ(files.size(), 2u);
  EXPECT_EQ(files.open(paths[0]), first) << "the one used longest ago is closed";
  std::filesystem::remove(paths[2]);
  files.close_stale(60);
  EXPECT_EQ(files.size(), 1u);
  files.close_stale(-1);
  EXPECT_EQ(files.size(), 0u);
  EXPECT_EQ(first->digest().size(), 32u) << "who uses it still can";
}

}  // namespace
}  // namespace voxdag::server
