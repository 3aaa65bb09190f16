#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <regex>
#include <span>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "core/image/image_reader.h"
#include "scene/formats/formats.h"
#include "server/http/message/digest_field.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

using Api = RunningService;

// Two triangles that form a red square.
constexpr const char* kRedSquare =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 230 0 0\n1 0 0 230 0 0\n1 0.2 1 230 0 0\n0 0.2 1 230 0 0\n3 0 1 2\n3 0 2 3\n";

class BytesOfText : public EncodedBytes {
 public:
  explicit BytesOfText(const std::string& text) : text_(text) {}
  size_t read(std::span<std::byte> out) override {
    const size_t size = std::min(out.size(), text_.size() - at_);
    std::memcpy(out.data(), text_.data() + at_, size);
    at_ += size;
    return size;
  }

 private:
  const std::string& text_;
  size_t at_ = 0;
};

// Returns the number of clearly red pixels in a PNG picture.
uint64_t red_pixels(const std::string& png) {
  MemoryBudget budget(uint64_t{1} << 28);
  BytesOfText bytes(png);
  const auto image = open_image(bytes, budget);
  EXPECT_EQ(image->bits(), 8);
  std::vector<std::byte> row(4 * size_t{image->width()});
  uint64_t red = 0;
  for (uint32_t y = 0; y < image->height(); ++y) {
    image->read_row(row);
    for (size_t at = 0; at < row.size(); at += 4)
      red += static_cast<int>(row[at]) > 80 + static_cast<int>(row[at + 1]);
  }
  return red;
}

// Uploads a scene, runs a job, and downloads the result, which has the bytes of `voxdag build`.
TEST_F(Api, TurnsASceneIntoADag) {
  start();
  ASSERT_EQ(put_scene("m.glb", scene_bytes()).status, 201);
  const std::string id =
      post_job({{"scene", "m.glb"}, {"resolution", 512}, {"name", "my \u00e9 job"}});
  ASSERT_TRUE(until_state(id, "succeeded"));
  const Json done = job(id);
  EXPECT_EQ(done["attempts"], 1);
  EXPECT_EQ(done["progress"]["overall"], Json({{"fraction", 1.0}, {"eta_s", 0.0}}));
  EXPECT_EQ(done["progress"]["subvolumes"]["built"], done["progress"]["subvolumes"]["total"]);
  EXPECT_EQ(done["result"]["levels"].size(), 8u);

  const std::string local = folder_.file("local.vdag");
  const std::string command = std::string(VOXDAG_BINARY) + " build " + folder_.file("menger.glb") +
                              " -r 512 -o " + local + " >/dev/null 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const std::string expected = read_small_file(system_files(), local, 1 << 30);
  const ClientResponse dag = http_->get("/api/v1/jobs/" + id + "/dag");
  EXPECT_EQ(dag.status, 200);
  EXPECT_TRUE(dag.body == expected) << "the bytes differ from those of voxdag build";
  EXPECT_EQ(dag.header("ETag"), '"' + sha256_hex(expected) + '"');
  EXPECT_NE(dag.header("Content-Disposition").find("\"my-job-512.vdag\""), std::string::npos);

  const Json report = Json::parse(http_->get("/api/v1/jobs/" + id + "/report").body);
  EXPECT_EQ(report["sha256"], done["result"]["sha256"]);
  EXPECT_EQ(report["output"], "my-job-512.vdag");
  const Json cubes = Json::parse(http_->get("/api/v1/jobs/" + id + "/subvolumes").body);
  EXPECT_EQ(cubes["cubes"].size(), cubes["total"].get<size_t>());
  EXPECT_EQ(cubes["built"], cubes["total"]);
  const Json rates = Json::parse(http_->get("/api/v1/jobs/" + id + "/rates").body);
  ASSERT_EQ(rates["stages"].size(), done["progress"]["stages"].size());
  for (size_t i = 0; i < rates["stages"].size(); ++i) {
    const Json &stage = done["progress"]["stages"][i], &points = rates["stages"][i]["points"];
    EXPECT_EQ(rates["stages"][i]["name"], stage["name"]);
    EXPECT_EQ(rates["stages"][i]["unit"], stage["unit"]);
    ASSERT_FALSE(points.empty()) << stage["name"];
    EXPECT_EQ(points.back()[0], stage["wall_s"]);
  }
  EXPECT_EQ(done["progress"]["rate"], rates["stages"].back()["points"].back()[1]);
  const std::string text = http_->get("/api/v1/jobs/" + id + "/log").body;
  EXPECT_NE(text.find("merge: "), std::string::npos) << text;
  EXPECT_EQ(text.find(folder_.path()), std::string::npos) << "contains a path of this machine";
  EXPECT_EQ(http_->send("DELETE", "/api/v1/jobs/" + id, "").status, 204);
  EXPECT_EQ(http_->get("/api/v1/jobs/" + id).status, 404);
  EXPECT_FALSE(std::filesystem::exists(config_.data_folder + "/jobs/" + id));
}

TEST_F(Api, RendersAPreview) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 16}});
  ASSERT_TRUE(until_state(id, "succeeded"));
  EXPECT_TRUE(until([&] { return job(id)["preview"] == true; }));
  EXPECT_TRUE(http_->get("/api/v1/jobs/" + id + "/preview.png").body.starts_with("\x89PNG"));
}

// The preview of a job with colors shows the colors. The preview of the same scene without colors
// does not.
TEST_F(Api, RendersColorsInAPreview) {
  start();
  ASSERT_EQ(put_scene("red.ply", kRedSquare).status, 201);
  for (const bool color : {true, false}) {
    const std::string id =
        post_job({{"scene", "red.ply"}, {"resolution", 64}, {"options", {{"color", color}}}});
    ASSERT_TRUE(until_state(id, "succeeded"));
    EXPECT_EQ(job(id)["options"]["color"], color);
    ASSERT_TRUE(until([&] { return job(id)["preview"] == true; }));
    const uint64_t red = red_pixels(http_->get("/api/v1/jobs/" + id + "/preview.png").body);
    EXPECT_TRUE(color ? red > 10000 : red == 0) << red;
  }
}

TEST_F(Api, ServesRanges) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}});
  ASSERT_TRUE(until_state(id, "succeeded"));
  const std::string path = "/api/v1/jobs/" + id + "/dag";
  const ClientResponse whole = http_->get(path);
  const std::string tag = whole.header("ETag"), size = std::to_string(whole.body.size());
  const auto get = [&](const client::HeaderMap& headers) { return http_->get(path, headers); };

  ClientResponse part = get({{"Range", "bytes=10-19"}});
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, whole.body.substr(10, 10));
  EXPECT_EQ(part.header("Content-Range"), "bytes 10-19/" + size);
  part = get({{"Range", "bytes=100-"}, {"If-Range", tag}});
  EXPECT_EQ(part.body, whole.body.substr(100));
  EXPECT_EQ(get({{"Range", "bytes=100-"}, {"If-Range", "\"other\""}}).status, 200);
  // With Connection: close, the server ends the connection after the answer. Otherwise cpp-httplib
  // 0.11 would wait for a body, which an answer with status 304 does not have.
  EXPECT_EQ(get({{"If-None-Match", tag}, {"Connection", "close"}}).status, 304);
  part = get({{"Range", "bytes=0-3,8-11"}});
  EXPECT_EQ(part.status, 206);
  EXPECT_TRUE(part.header("Content-Type").starts_with("multipart/byteranges; boundary="));
  EXPECT_NE(
      part.body.find("Content-Range: bytes 8-11/" + size + "\r\n\r\n" + whole.body.substr(8, 4)),
      std::string::npos);
  const ClientResponse outside = get({{"Range", "bytes=" + size + "-"}});
  EXPECT_EQ(not_problem(outside, 416, "range_not_satisfiable"), "");
  EXPECT_EQ(outside.header("Content-Range"), "bytes */" + size);
  const ClientResponse head = http_->head(path);
  EXPECT_EQ(head.header("Content-Length"), size);
  EXPECT_TRUE(head.body.empty());
}

TEST_F(Api, ResumesABrokenUpload) {
  start();
  const std::string bytes = scene_bytes(), path = "/api/v1/scenes/m.glb";
  const std::string size = std::to_string(bytes.size()), half = std::to_string(bytes.size() / 2);
  // Sends an upload whose connection ends in the middle of the body.
  const int port = std::stoi(url().substr(url().rfind(':') + 1));
  raw_exchange(port, "PUT " + path + " HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + size +
                         "\r\n\r\n" + bytes.substr(0, bytes.size() / 2));
  ASSERT_TRUE(until([&] { return http_->head(path).header("Upload-Offset") == half; }));
  EXPECT_EQ(http_->head(path).header("Upload-Length"), size);
  EXPECT_EQ(
      not_problem(post("/api/v1/jobs", {{"scene", "m.glb"}, {"resolution", 64}}), 409, "conflict"),
      "");
  const auto range = [&](const std::string& first) {
    return client::HeaderMap{
        {"Content-Range", "bytes " + first + "-" + std::to_string(bytes.size() - 1) + "/" + size}};
  };
  const std::string rest = bytes.substr(bytes.size() / 2);
  const ClientResponse wrong =
      put_scene("m.glb", rest.substr(1), range(std::to_string(bytes.size() / 2 + 1)));
  EXPECT_EQ(not_problem(wrong, 409, "conflict"), "");
  EXPECT_EQ(wrong.header("Upload-Offset"), half);
  client::HeaderMap headers = range(half);
  headers.emplace("Repr-Digest", digest_field(sha256_hex(bytes)));
  const ClientResponse done = put_scene("m.glb", rest, headers);
  EXPECT_EQ(done.status, 201) << done.body;
  EXPECT_EQ(Json::parse(done.body)["sha256"], sha256_hex(bytes));
}

TEST_F(Api, RejectsAWrongChecksum) {
  start();
  const client::HeaderMap wrong = {{"Content-Digest", digest_field(sha256_hex("other"))}};
  EXPECT_EQ(not_problem(put_scene("m.glb", "hello", wrong), 400, "invalid_input"), "");
  EXPECT_EQ(http_->get("/api/v1/scenes/m.glb").status, 404);
}

TEST_F(Api, IsIdempotentWithAKey) {
  start();
  put_scene("m.glb", scene_bytes());
  const Json body = {{"scene", "m.glb"}, {"resolution", 64}};
  const client::HeaderMap key = {{"Idempotency-Key", "k1"}};
  const ClientResponse first = post("/api/v1/jobs", body, key);
  const ClientResponse again = post("/api/v1/jobs", body, key);
  EXPECT_EQ(again.status, 202);
  EXPECT_EQ(again.header("Location"), first.header("Location"));
  EXPECT_EQ(again.header("Idempotent-Replayed"), "true");
  EXPECT_EQ(not_problem(post("/api/v1/jobs", {{"scene", "m.glb"}, {"resolution", 128}}, key), 422,
                        "idempotency_mismatch"),
            "");
}

// Cancels, suspends, resumes and retries a job that would run for minutes.
TEST_F(Api, ControlsJobs) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 16384}});
  const std::string path = "/api/v1/jobs/" + id;
  ASSERT_TRUE(until_state(id, "running"));
  EXPECT_EQ(not_problem(http_->send("DELETE", path, ""), 409, "conflict"), "");
  EXPECT_EQ(not_problem(http_->send("DELETE", "/api/v1/scenes/m.glb", ""), 409, "conflict"), "");
  EXPECT_EQ(post(path + "/suspend").status, 202);
  EXPECT_EQ(job(id)["state"], "suspended");
  EXPECT_EQ(post(path + "/suspend").status, 202) << "suspending a suspended job changes nothing";
  EXPECT_EQ(not_problem(post(path + "/retry"), 409, "conflict"), "");
  EXPECT_EQ(post(path + "/resume").status, 202);
  ASSERT_TRUE(until_state(id, "running"));
  EXPECT_EQ(job(id)["attempts"], 1) << "resuming does not start a new attempt";
  EXPECT_EQ(post(path + "/cancel").status, 202);
  ASSERT_TRUE(until_state(id, "canceled"));
  EXPECT_EQ(not_problem(post(path + "/resume"), 409, "conflict"), "");
  EXPECT_EQ(post(path + "/retry").status, 202);
  ASSERT_TRUE(until_state(id, "running"));
  EXPECT_EQ(post(path + "/cancel").status, 202);
  ASSERT_TRUE(until_state(id, "canceled"));
  EXPECT_FALSE(std::filesystem::exists(config_.data_folder + "/jobs/" + id + "/work"));
  const Json list = Json::parse(http_->get("/api/v1/jobs?state=canceled&limit=1").body);
  EXPECT_EQ(list["jobs"].at(0)["id"], id);
  EXPECT_EQ(list["counts"]["canceled"], 1);
}

TEST_F(Api, EstimatesAJob) {
  start();
  put_scene("m.glb", scene_bytes());
  const ClientResponse plan =
      post("/api/v1/jobs?dry_run=true", {{"scene", "m.glb"}, {"resolution", 1024}});
  ASSERT_EQ(plan.status, 200) << plan.body;
  EXPECT_GT(Json::parse(plan.body)["voxels"]["likely"], 0);
  EXPECT_TRUE(Json::parse(http_->get("/api/v1/jobs").body)["jobs"].empty());
  put_scene("bad.glb", "no scene at all");
  EXPECT_EQ(post("/api/v1/jobs?dry_run=true", {{"scene", "bad.glb"}, {"resolution", 64}}).status,
            400);
}

// The event stream of a job begins with the job's data and reports every change until the job ends.
// A request with the header Last-Event-ID gets the events after the event with this id.
TEST_F(Api, StreamsEvents) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 512}});
  const auto follow = [&](const client::HeaderMap& headers) {
    std::string text;
    const ClientResponse response = http_->stream(
        "/api/v1/jobs/" + id + "/events", headers,
        [](const ClientResponse& r) { return r.status == 200; },
        [&](std::string_view piece) {
          text += piece;
          return true;
        });
    EXPECT_EQ(response.header("Content-Type"), "text/event-stream");
    return text;
  };
  const std::string text = follow({});
  EXPECT_TRUE(text.starts_with("retry: 3000\n\nevent: job\nid: ")) << text;
  EXPECT_NE(text.find("event: end\ndata: {\"state\":\"succeeded\"}\n\n"), std::string::npos);
  const std::string again = follow({{"Last-Event-ID", "0"}});
  for (const char* state : {"queued", "running", "succeeded"})
    EXPECT_NE(again.find("\"state\":\"" + std::string(state) + "\",\"attempt\""), std::string::npos)
        << again;
}

TEST_F(Api, ReportsWhyAJobFailed) {
  start();
  put_scene("bad.glb", "no scene at all");
  const std::string id = post_job({{"scene", "bad.glb"}, {"resolution", 64}});
  ASSERT_TRUE(until([&] { return job(id)["state"] == "failed"; }));
  const Json error = job(id)["error"];
  EXPECT_EQ(error["code"], "invalid_input");
  EXPECT_NE(error["message"].get<std::string>().find("bad.glb"), std::string::npos) << error;
  EXPECT_EQ(error["message"].get<std::string>().find(folder_.path()), std::string::npos) << error;
  EXPECT_EQ(not_problem(http_->get("/api/v1/jobs/" + id + "/dag"), 404, "not_found"), "");
}

// Messages for clients name a scene as the client did, and contain no folder of the service's
// machine.
TEST_F(Api, NamesNoFolderOfItsMachine) {
  start();
  const auto expect_no_path = [&](const std::string& id) {
    for (const char* part : {"", "/log", "/subvolumes"}) {
      const std::string body = http_->get("/api/v1/jobs/" + id + part).body;
      EXPECT_EQ(body.find(folder_.path()), std::string::npos) << body;
    }
    std::string events;
    http_->stream(
        "/api/v1/jobs/" + id + "/events", {{"Last-Event-ID", "0"}},
        [](const ClientResponse& r) { return r.status == 200; },
        [&](std::string_view piece) {
          events += piece;
          return true;
        });
    EXPECT_EQ(events.find(folder_.path()), std::string::npos) << events;
  };
  put_scene("gone.glb", scene_bytes());
  std::filesystem::remove(config_.data_folder + "/scenes/files/gone.glb");
  EXPECT_EQ(post("/api/v1/jobs", {{"scene", "gone.glb"}, {"resolution", 64}}).status, 404);

  put_scene("m.glb", scene_bytes());
  const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 16384}});
  const std::string work = config_.data_folder + "/jobs/" + id + "/work";
  ASSERT_TRUE(until([&] { return std::filesystem::exists(work + "/lock"); }));
  post("/api/v1/jobs/" + id + "/suspend");
  // The job's process can still write files, so the test waits until the process has ended.
  ASSERT_TRUE(until([&] {
    return http_->get("/metrics").body.find("voxdag_job_processes 0") != std::string::npos;
  }));
  // If the job was suspended before the build had a plan, the build has removed its work folder.
  std::filesystem::create_directories(work);
  for (const char* suffix : {"-wal", "-shm"}) std::filesystem::remove(work + "/job.db" + suffix);
  write_file_atomically(system_files(), work + "/job.db", std::string(8192, 'x'));
  post("/api/v1/jobs/" + id + "/resume");
  ASSERT_TRUE(until([&] { return job(id)["state"] == "failed"; }));
  EXPECT_NE(job(id)["error"]["message"].get<std::string>().find("job.db"), std::string::npos)
      << job(id)["error"];
  expect_no_path(id);
}

// A scene may be given by its path only if the path is inside a scene root.
TEST_F(Api, AcceptsScenesInsideItsRootsOnly) {
  std::filesystem::create_directories(folder_.file("root/sub"));
  std::filesystem::create_directories(folder_.file("secret"));
  const std::string bytes = scene_bytes();
  write_file_atomically(system_files(), folder_.file("root/sub/a.glb"), bytes);
  write_file_atomically(system_files(), folder_.file("secret/b.glb"), bytes);
  std::filesystem::create_symlink(folder_.file("secret"), folder_.file("root/link"));
  config_.scene_roots = {folder_.file("root")};
  start();
  const auto status = [&](const std::string& scene) {
    return post("/api/v1/jobs", {{"scene", scene}, {"resolution", 64}}).status;
  };
  EXPECT_EQ(status(folder_.file("root/sub/a.glb")), 202);
  for (const char* name :
       {"secret/b.glb", "root/link/b.glb", "root/../secret/b.glb", "root/none.glb", "root/sub"}) {
    SCOPED_TRACE(name);
    EXPECT_EQ(status(folder_.file(name)), 404);
  }
  EXPECT_EQ(status("../secret/b.glb"), 404);
  EXPECT_EQ(status("/etc/passwd"), 404);
}

// The OpenAPI document, the pages and the error messages list all file endings of the scene
// formats.
TEST_F(Api, ListsTheEndingsOfTheSceneFormats) {
  start();
  std::string suffixes = list_scene_endings("|", "|");
  std::erase(suffixes, '.');
  const std::string document = http_->get("/openapi.json").body;
  EXPECT_NE(document.find("[Gg][Ll][Bb]"), std::string::npos);
  EXPECT_NE(document.find(list_scene_endings()), std::string::npos);
  EXPECT_NE(http_->get("/lib/scene_upload.js").body.find('"' + suffixes + '"'), std::string::npos);
  const ClientResponse refused = http_->get("/api/v1/scenes/a.doc");
  EXPECT_EQ(refused.status, 400);
  EXPECT_NE(refused.body.find(list_scene_endings()), std::string::npos) << refused.body;
  for (const SceneFormat& format : scene_formats())
    for (const std::string_view ending : format.endings) {
      const std::string name = std::string(128 - ending.size(), 'a') + std::string(ending);
      EXPECT_EQ(http_->get("/api/v1/scenes/" + name).status, 404) << name;
      EXPECT_EQ(http_->get("/api/v1/scenes/a" + name).status, 400) << name;
    }
  EXPECT_EQ(http_->get("/api/v1/scenes/PART.STL").status, 404);
}

// The OpenAPI document is generated from the routes, so it lists every route. It could only omit a
// status, which RunningService checks, or differ from docs/api.md, which this test checks.
TEST_F(Api, TheDocumentAndThePageListTheSameRequests) {
  start();
  const Json api = Json::parse(http_->get("/openapi.json").body);
  EXPECT_EQ(api["openapi"], "3.1.0");
  const std::string page =
      read_small_file(system_files(), VOXDAG_SOURCE_DIR "/docs/api.md", uint64_t{1} << 20);
  for (const auto& [path, operations] : api.at("paths").items()) {
    // docs/api.md does not have a line for each of the routes below /partial/, which serve the
    // tiles of unfinished jobs.
    const bool is_partial = path.find("/partial/") != std::string::npos;
    for (const auto& [method, operation] : operations.items()) {
      std::string request = method + ' ' + path;
      std::transform(request.begin(), request.begin() + static_cast<long>(method.size()),
                     request.begin(), [](unsigned char c) { return std::toupper(c); });
      SCOPED_TRACE(request);
      const size_t found = std::min(page.find('`' + request), page.find("`, `HEAD " + path));
      EXPECT_TRUE(found != std::string::npos || is_partial);
      for (const Json& parameter : operation.value("parameters", Json::array()))
        EXPECT_NE(page.find(parameter.at("name").get<std::string>()), std::string::npos);
      for (const auto& [status, answer] : operation.at("responses").items())
        EXPECT_TRUE(page.find(status) != std::string::npos) << status;
    }
  }
  const std::regex row("\\| `(GET|PUT|POST|PATCH|DELETE)`?(, `HEAD)? (/[^ ?`]*)");
  for (std::sregex_iterator match(page.begin(), page.end(), row), end; match != end; ++match) {
    std::string method = (*match)[1];
    for (char& c : method) c = static_cast<char>(std::tolower(c));
    EXPECT_TRUE(api["paths"][(*match)[3].str()].contains(method)) << match->str();
  }
}

TEST_F(Api, DescribesItself) {
  start();
  EXPECT_EQ(http_->get("/healthz").status, 200);
  EXPECT_EQ(http_->get("/readyz").status, 200);
  EXPECT_EQ(Json::parse(http_->get("/version").body)["api"], "v1");
  const std::string metrics = http_->get("/metrics").body;
  for (const char* name : {"voxdag_jobs{state=\"queued\"} 0",
                           "voxdag_http_request_duration_seconds_count", "voxdag_free_disk_bytes"})
    EXPECT_NE(metrics.find(name), std::string::npos) << metrics;
  for (const char* file :
       {"/", "/app.js", "/pages/job_page.js", "/views/parts.js", "/lib/api.js"}) {
    SCOPED_TRACE(file);
    const ClientResponse asset = http_->get(file);
    EXPECT_EQ(asset.status, 200);
    EXPECT_EQ(asset.header("Content-Type"), std::string(file) == "/"
                                                ? "text/html; charset=utf-8"
                                                : "text/javascript; charset=utf-8");
    const client::HeaderMap known = {{"If-None-Match", asset.header("ETag")},
                                     {"Connection", "close"}};
    EXPECT_EQ(http_->get(file, known).status, 304);
  }
  const ClientResponse nothing = http_->get("/nothing/here");
  EXPECT_EQ(not_problem(nothing, 404, "not_found"), "");
  EXPECT_EQ(nothing.header("X-Content-Type-Options"), "nosniff");
  const ClientResponse method = http_->send("DELETE", "/api/v1/jobs", "");
  EXPECT_EQ(not_problem(method, 405, "method_not_allowed"), "");
  EXPECT_EQ(method.header("Allow"), "POST, GET, HEAD");
}

// A second service with the same data folder is refused, because it would start the same jobs.
TEST_F(Api, LocksItsDataFolder) {
  start();
  EXPECT_THROW(Service(config_, system_files(), [](const LogEntry&) {}), Error);
}

// The log reports each request that changes something, with the name of the client. It does not
// report reads.
TEST_F(Api, WritesAnAuditLog) {
  start();
  put_scene("m.glb", "x");
  http_->get("/api/v1/scenes");
  const std::string text = log();
  EXPECT_NE(text.find("audit PUT /api/v1/scenes/m.glb status=201 who=local from=127.0.0.1"),
            std::string::npos)
      << text;
  EXPECT_EQ(text.find("audit GET"), std::string::npos);
}

TEST_F(Api, WritesAnAccessLog) {
  config_.access_log = true;
  start();
  http_->get("/api/v1/scenes?limit=1");
  http_->get("/none%20access%20GET");
  const std::string text = log();
  EXPECT_NE(text.find("access GET /api/v1/scenes status=200 who=local from=127.0.0.1 request="),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("access GET /none%20access%20GET status=404 who="), std::string::npos)
      << text;
  http_->get("/" + std::string(198, 'a') + "\x80");
  http_->get("/" + std::string(199, 'b'));
  const std::string cut = "access GET /" + std::string(198, 'a') + "... status=";
  EXPECT_NE(log().find(cut), std::string::npos) << log();
  EXPECT_NE(log().find("GET /" + std::string(199, 'b') + " status="), std::string::npos) << log();
}

// Errors of jobs name options as the members of the request, not as the command line spells them.
TEST_F(Api, NamesOptionsAsMembers) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id = post_job(
      {{"scene", "m.glb"}, {"resolution", 64}, {"options", {{"bounds", {1000, 1000, 1000, 1}}}}});
  ASSERT_TRUE(until_state(id, "failed"));
  const std::string message = job(id)["error"]["message"];
  EXPECT_NE(message.find("'allow_empty'"), std::string::npos) << message;
  EXPECT_EQ(message.find("--"), std::string::npos) << message;
}

}  // namespace
}  // namespace voxdag::server
