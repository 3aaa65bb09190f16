// Tests submit, jobs, watch, cancel, suspend, resume and download with a real server.
#include <gmock/gmock.h>
#include <pty.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <sstream>
#include <thread>
#include <utility>

#include "client/http_client.h"
#include "tests/cli/command_line.h"
#include "tests/cli/serve_process.h"

namespace command_line {
namespace {

using namespace std::string_literals;

class Client : public CommandLine {
 protected:
  void SetUp() override {
    make_scene();
    std::filesystem::create_directory(folder_.file("server"));
    start_server();
    ASSERT_NE(server_->url(), "") << server_->log();
  }
  void TearDown() override {
    unsetenv("VOXDAG_SERVER");
    if (server_) {
      EXPECT_EQ(server_->stop(), 0) << server_->log();
    }
  }
  void start_server(const std::vector<std::string>& more = {}, const std::string& port = "0") {
    server_.reset();
    server_ = std::make_unique<ServeProcess>(folder_.file("server"), more, port);
    setenv("VOXDAG_SERVER", server_->url().c_str(), 1);
  }

  std::string submit(const std::string& resolution, std::vector<std::string> more = {}) {
    std::vector<std::string> args = {"submit", "m.glb", "-r", resolution};
    args.insert(args.end(), more.begin(), more.end());
    return run_json(args).at("id");
  }
  // Submits a job that runs for minutes on any machine, and returns its id.
  std::string submit_long() {
    EXPECT_EQ(run({"generate", "soup", "long.glb", "--triangles", "50000"}).status, 0);
    return run_json({"submit", "long.glb", "-r", "32768", "--threads", "1"}).at("id");
  }
  std::string state(const std::string& id) {
    const Json listed = run_json({"jobs"});
    for (const Json& job : listed.at("jobs"))
      if (job.at("id") == id) return job.at("state");
    return "";
  }
  // Expects that the job reaches this state within a minute. A running job takes a moment to stop.
  void expect_state_eventually(const std::string& id, const std::string& expected) {
    for (int i = 0; i < 1200 && state(id) != expected; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_EQ(state(id), expected);
  }
  // Returns the value of a metric without labels; -1 if it is missing.
  double metric(const std::string& name) {
    const std::string text = http().get("/metrics").body;
    const size_t at = text.find("\n" + name + " ");
    return at == std::string::npos ? -1 : std::stod(text.substr(at + name.size() + 2));
  }
  voxdag::client::HttpClient http() {
    voxdag::client::ClientOptions options;
    options.url = server_->url();
    return voxdag::client::HttpClient(options);
  }

  std::unique_ptr<ServeProcess> server_;
};

// Submits a local scene, and downloads and verifies the result. The file has the bytes of a local
// build.
TEST_F(Client, BuildsTheSameBytesAsTheBuildCommand) {
  const Json job = run_json({"submit", "m.glb", "-r", "128", "--hash-bits", "16", "--name",
                             "sponge", "--memory", "256MiB", "--wait"});
  EXPECT_EQ(job["state"], "succeeded");
  EXPECT_EQ(job["name"], "sponge");
  EXPECT_EQ(job["options"]["hash_bits"], 16);
  const std::string id = job["id"];
  const Json report = run_json({"download", id, "-o", "out/got.vdag"});
  EXPECT_EQ(report["resumed_bytes"], 0);
  EXPECT_EQ(report["sha256"], job["result"]["sha256"]);
  EXPECT_EQ(report["bytes"], contents("out/got.vdag").size());
  EXPECT_EQ(run({"verify", "out/got.vdag", "--against", "m.glb"}).status, 0);
  const Json built = run_json({"build", "m.glb", "-r", "128", "--hash-bits", "16", "-o", "m.vdag"});
  EXPECT_EQ(built["sha256"], report["sha256"]);

  const Answer listed = run({"jobs"});
  for (const char* part : {"STATE", "succeeded", "sponge", "128"})
    EXPECT_NE(listed.out.find(part), std::string::npos) << listed.out;
  EXPECT_NE(listed.out.find(id), std::string::npos) << listed.out;
  EXPECT_EQ(run_json({"jobs", "--state", "failed,queued"})["jobs"].size(), 0u);

  // Watching an ended job shows its stages and the result.
  const Answer watched = run({"watch", id});
  EXPECT_EQ(watched.status, 0);
  EXPECT_NE(watched.err.find("\nbuild "), std::string::npos) << watched.err;
  for (const auto& quiet : std::vector<std::vector<std::string>>{
           {"watch", id, "-q"},
           {"download", id, "-o", "q.vdag", "-q"},
           {"download", id, "--to", "npz", "-o", "q.npz", "-q"}}) {
    const Answer answer = run(quiet);
    EXPECT_EQ(answer.status, 0) << answer.err;
    EXPECT_EQ(answer.out + answer.err, "") << quiet[0];
  }
  EXPECT_NE(watched.out.find(report["sha256"].get<std::string>()), std::string::npos);
}

// Without -r, `submit` finds the resolution for --voxel-size, as `build` does. It cannot do this
// for a scene that is not on this machine.
TEST_F(Client, FindsTheResolutionForAVoxelSize) {
  for (const std::string& voxel_size : {"0.013"s, "0.3"s}) {
    const Json job = run_json({"submit", "m.glb", "--voxel-size", voxel_size, "--wait"});
    const Json built = run_json({"build", "m.glb", "--voxel-size", voxel_size, "-o", "m.vdag"});
    EXPECT_EQ(job["resolution"], built["resolution"]);
    EXPECT_EQ(job["result"]["sha256"], built["sha256"]);
  }
  const std::string uploaded = run_json({"jobs"})["jobs"][0]["scene"][0];
  expect_error(2, "the scene '" + uploaded + "' is not on this machine",
               {"submit", uploaded, "--voxel-size", "0.3"});
  expect_error(2, "or a voxel size instead", {"submit", "m.glb"});
  expect_error(2, "expected a voxel size of at least", {"submit", "m.glb", "--voxel-size", "1e-9"});
  EXPECT_EQ(run_json({"jobs"})["jobs"].size(), 2u);
}

// `submit --label` labels a job, and `jobs` finds jobs by a label or by a part of it. Invalid
// labels are refused before the upload.
TEST_F(Client, LabelsAndFindsJobs) {
  const std::string night = "night run \xc3\xa9 100% &label=b";
  const Json first =
      run_json({"submit", "m.glb", "-r", "16", "--name", "one", "--label", night, "--label", "b"});
  const Json second = run_json({"submit", "m.glb", "-r", "16", "--name", "two", "--labels", "b"});
  EXPECT_EQ(first["labels"], Json({night, "b"}));
  EXPECT_EQ(second["labels"], Json({"b"}));
  const auto found = [&](const char* option, const std::string& text) {
    std::string names;
    const Json answer = run_json({"jobs", option, text});
    for (const Json& job : answer["jobs"]) names += job["name"].get<std::string>() + " ";
    return names;
  };
  EXPECT_EQ(found("--label", night), "one ");
  EXPECT_EQ(found("--label", "b"), "two one ");
  EXPECT_EQ(found("--label", "night"), "");
  EXPECT_EQ(found("--find", "RUN"), "one ");
  EXPECT_EQ(found("--find", second["id"].get<std::string>().substr(0, 9)), "two ");
  const Answer listed = run({"jobs", "--label", night});
  EXPECT_NE(listed.out.find("one  #" + night + "  #b"), std::string::npos) << listed.out;
  EXPECT_NE(listed.out.find("  AGE  RESOLUTION"), std::string::npos) << listed.out;
  EXPECT_TRUE(listed.out.find(" s  ") != std::string::npos ||
              listed.out.find(" min  ") != std::string::npos)
      << listed.out;

  // Ids can be shortened as long as they are unique. Of 17 ids, two begin with the same digit.
  const std::string id = first["id"];
  EXPECT_EQ(run_json({"watch", id.substr(0, 15)})["id"], id);
  std::string same;
  for (std::map<char, std::string> ids; same.empty();) {
    const std::string next = run_json({"submit", "m.glb", "-r", "16"}).at("id");
    if (const std::string other = std::exchange(ids[next[0]], next); !other.empty()) same = next;
  }
  expect_error(2, "begin with it: expected more digits", {"watch", same.substr(0, 1)});

  const double uploaded = metric("voxdag_uploaded_bytes_total");
  ASSERT_EQ(run({"generate", "soup", "other.glb", "--triangles", "10"}).status, 0);
  for (const std::string& label : {std::string(65, 'x'), std::string("a\nb"), std::string()})
    expect_error(2, "--label: item 1 of 1: expected 1 to 16 items, each 1 to 64 characters",
                 {"submit", "other.glb", "-r", "16", "--label", label});
  std::vector<std::string> many = {"submit", "other.glb", "-r", "16"};
  for (int i = 0; i < 17; ++i) many.insert(many.end(), {"--label", std::to_string(i)});
  expect_error(2, "--label: 17 items", many);
  EXPECT_EQ(metric("voxdag_uploaded_bytes_total"), uploaded);
}

// On a terminal, `jobs` cuts each line to the terminal's width. Otherwise it prints complete lines.
TEST_F(Client, CutsTheTableAtTheWidthOfTheTerminal) {
  const std::string name = "begin of the name, " + std::string(100, 'x') + " end";
  run_json({"submit", "m.glb", "-r", "16", "--name", name});
  EXPECT_NE(run({"jobs"}).out.find(name + "\n"), std::string::npos);
  constexpr size_t kColumns = 96;
  struct winsize size {};
  size.ws_col = kColumns;
  int terminal = -1, program = -1;
  ASSERT_EQ(openpty(&terminal, &program, nullptr, nullptr, &size), 0);
  EXPECT_EQ(wait_for(start({"jobs"}, program)).status, 0);
  close(program);
  std::string text;
  char bytes[4096];
  for (ssize_t n; (n = read(terminal, bytes, sizeof bytes)) > 0;)
    text.append(bytes, static_cast<size_t>(n));
  close(terminal);
  EXPECT_NE(text.find("  begin of t"), std::string::npos) << text;
  EXPECT_NE(text.find("\u2026\r\n"), std::string::npos) << text;
  EXPECT_EQ(text.find(" end"), std::string::npos) << text;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    EXPECT_LE(line.size(), kColumns + 3) << line;  // with two more bytes of the ellipsis, and CR
}

// With --log-format json, each line of the log is a JSON object. With --access-log, requests that
// only read are in the log.
TEST_F(Client, ServesWithALogOfJson) {
  start_server({"--log-format", "json", "--access-log"});
  const std::string id = submit("16", {"--wait"});
  EXPECT_EQ(state(id), "succeeded");
  EXPECT_EQ(server_->stop(), 0);
  std::istringstream lines(server_->log());
  std::map<std::string, int> count;
  for (std::string line; std::getline(lines, line);) {
    const Json entry = Json::parse(line, nullptr, false);
    ASSERT_TRUE(entry.is_object()) << line;
    EXPECT_EQ(entry.at("time").get<std::string>().size(), 24u) << line;
    const std::string message = entry.at("message");
    if (entry.value("job", "") == id) ++count[message];
    if (!entry.contains("request")) continue;
    EXPECT_EQ(entry["level"], "info");
    ++count[message.substr(0, message.find(' '))];
    if (entry["request"]["method"] == "GET" && entry["request"]["path"] == "/api/v1/jobs")
      ++count["list"];
  }
  for (const std::string& expected :
       {"job " + id + " running", "job " + id + " succeeded", std::string("audit"),
        std::string("access"), std::string("list")})
    EXPECT_GE(count[expected], 1) << expected << "\n" << server_->log();
  EXPECT_NE(server_->log().find("\"stopped\""), std::string::npos);
  expect_error(2, "--log-format", {"serve", "--log-format", "xml", "--data", "x"});
  server_.reset();
}

// A file is uploaded only once. If the server has a part of the file, only the remaining part is
// sent.
TEST_F(Client, UploadsTheMissingPart) {
  const std::string scene = contents("m.glb");
  const Json job = run_json({"submit", "m.glb", "-r", "64"});
  const std::string name = job["scene"][0];
  EXPECT_EQ(name.substr(0, 2), "m-");
  EXPECT_EQ(metric("voxdag_uploaded_bytes_total"), scene.size());
  run_json({"submit", "m.glb", "-r", "32", "--wait"});
  EXPECT_EQ(metric("voxdag_uploaded_bytes_total"), scene.size());

  ASSERT_EQ(run({"watch", job["id"]}).status, 0);
  ASSERT_EQ(http().send("DELETE", "/api/v1/scenes/" + name, "").status, 204);
  const size_t half = scene.size() / 2;
  const auto part =
      http().upload("/api/v1/scenes/" + name, half,
                    [&](uint64_t offset, uint64_t max_bytes) {
                      return scene.substr(offset, std::min<uint64_t>(max_bytes, half - offset));
                    },
                    {{"Content-Range",
                      "bytes 0-" + std::to_string(half - 1) + "/" + std::to_string(scene.size())}});
  ASSERT_EQ(part.status, 202) << part.body;
  run_json({"submit", "m.glb", "-r", "16", "--wait"});
  EXPECT_EQ(metric("voxdag_uploaded_bytes_total"), 2 * scene.size());
}

// A download reads only the missing bytes if a partial file exists. If the partial file has wrong
// bytes, the download fails and removes it.
TEST_F(Client, ResumesADownload) {
  const Json job = run_json({"submit", "m.glb", "-r", "128", "--wait"});
  const std::string id = job["id"], sha256 = job["result"]["sha256"];
  const std::string partial = "got.vdag." + sha256.substr(0, 12) + ".partial";
  ASSERT_EQ(run({"download", id, "-o", "whole.vdag"}).status, 0);
  const std::string whole = contents("whole.vdag");

  put(partial, whole.substr(0, whole.size() / 2));
  const Json report = run_json({"download", id, "-o", "got.vdag"});
  EXPECT_EQ(report["resumed_bytes"], whole.size() / 2);
  EXPECT_TRUE(contents("got.vdag") == whole);
  EXPECT_FALSE(exists(partial));

  std::filesystem::remove(folder_.file("got.vdag"));
  put(partial, std::string(100, 'x'));
  expect_error(4, sha256, {"download", id, "-o", "got.vdag"});
  EXPECT_FALSE(exists("got.vdag"));
  EXPECT_FALSE(exists(partial));
  ASSERT_EQ(run({"download", id, "-o", "got.vdag"}).status, 0);
  EXPECT_TRUE(contents("got.vdag") == whole);
}

// `download --to` lets the server export the result. The files have the bytes of local exports.
TEST_F(Client, DownloadsExports) {
  const std::string id = run_json({"submit", "m.glb", "-r", "64", "--wait"}).at("id");
  ASSERT_EQ(run({"download", id, "-o", "m.vdag"}).status, 0);
  const Json report = run_json({"download", id, "--to", "npz", "--level", "5", "--region",
                                "0,0,0,16,16,16", "--compact", "-o", "got.npz"});
  EXPECT_EQ(report["files"][0]["output"], "got.npz");
  ASSERT_EQ(run({"export", "m.vdag", "--to", "npz", "--level", "5", "--region", "0,0,0,16,16,16",
                 "--compact", "-o", "local.npz"})
                .status,
            0);
  EXPECT_TRUE(contents("got.npz") == contents("local.npz"));
  ASSERT_EQ(run({"download", id, "--to", "hashdag", "-o", "got.basic_dag.dag.bin"}).status, 0);
  ASSERT_EQ(run({"export", "m.vdag", "--to", "hashdag", "-o", "local.basic_dag.dag.bin"}).status,
            0);
  for (const char* suffix : {".basic_dag.dag.bin", ".basic_dag.uncompressed_colors.bin"})
    EXPECT_TRUE(contents("got" + std::string(suffix)) == contents("local" + std::string(suffix)));
  ASSERT_EQ(run({"download", id, "--to", "vdag", "--level", "4", "-o", "coarse.vdag"}).status, 0);
  ASSERT_EQ(run({"extract", "m.vdag", "--level", "4", "-o", "local.vdag"}).status, 0);
  EXPECT_TRUE(contents("coarse.vdag") == contents("local.vdag"));

  // Warnings are printed also with --quiet. The middle of the sponge is empty.
  const std::vector<std::string> empty = {
      "download", id, "--to", "vdag", "--region", "30,30,30,34,34,34", "-o", "empty.vdag"};
  const std::string warning = "the selection has no voxels: the file will have no nodes";
  std::vector<std::string> quiet = empty;
  quiet.push_back("-q");
  const Answer answer = run(quiet);
  EXPECT_EQ(answer.status, 0);
  EXPECT_EQ(answer.out, "");
  EXPECT_EQ(answer.err, "voxdag: warning: " + warning + "\n");
  EXPECT_EQ(run_json(empty)["warnings"], Json({warning}));
  const std::string of_empty = run_json({"exports", id})["exports"][3]["id"];
  ASSERT_EQ(run({"exports", id, "--delete", of_empty}).status, 0);

  // Exports are listed, and deleted by their ids.
  const Json exports = run_json({"exports", id})["exports"];
  ASSERT_EQ(exports.size(), 3u);
  const std::string first = exports[0]["id"], second = exports[1]["id"];
  const Answer list = run({"exports", id});
  EXPECT_NE(list.out.find(first), std::string::npos) << list.out;
  EXPECT_NE(list.out.find(exports[0]["files"][0]["name"]), std::string::npos) << list.out;
  EXPECT_EQ(run_json({"exports", id, "--delete", first, "--delete", second}),
            (Json{{first, "deleted"}, {second, "deleted"}}));
  EXPECT_EQ(run_json({"exports", id})["exports"].size(), 1u);
  expect_error(3, first, {"exports", id, "--delete", first});
  expect_error(2, "16 hex digits", {"exports", id, "--delete", "nope"});

  expect_error(2, "--to FORMAT", {"download", id, "--level", "5", "-o", "x.vdag"});
  expect_error(2, "expected one of vdag", {"download", id, "--to", "fbx", "-o", "x.fbx"});
  expect_error(2, "--force", {"download", id, "--to", "ply", "-o", "m.glb"});
  expect_error(2, "--up", {"download", id, "--to", "ply", "--up", "x", "-o", "x.ply"});
}

// Jobs that wait in the queue behind a long job can be suspended, canceled and resumed.
TEST_F(Client, SuspendsCancelsAndResumes) {
  const std::string first = submit_long();
  const std::string suspended = submit("64"), canceled = submit("32");
  EXPECT_EQ(run({"suspend", suspended}).status, 0);
  EXPECT_EQ(state(suspended), "suspended");
  expect_error(3, "suspended", {"download", suspended, "-o", "x.vdag"});
  EXPECT_EQ(run({"cancel", canceled}).status, 0);
  EXPECT_EQ(state(canceled), "canceled");
  EXPECT_EQ(run({"watch", canceled}).status, 130);
  EXPECT_EQ(run_json({"resume", suspended})["state"], "queued");
  EXPECT_EQ(run_json({"resume", canceled})["state"], "queued");
  EXPECT_EQ(run({"cancel", first}).status, 0);
  expect_state_eventually(first, "canceled");
  for (const std::string& id : {suspended, canceled}) EXPECT_EQ(run({"watch", id}).status, 0);
}

// `watch` waits while the server restarts, and the job continues.
TEST_F(Client, WatchesAcrossARestart) {
  const std::string first = submit_long(), id = submit("64");
  const std::string url = server_->url();
  const pid_t watcher = start({"watch", id, "--json"});
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (contents(".stderr").find("queued") == std::string::npos) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline) << "the watcher says nothing";
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(server_->stop(), 0);
  start_server({}, url.substr(url.rfind(':') + 1));
  if (server_->url().empty()) {
    kill(watcher, SIGINT);
    wait_for(watcher);
    GTEST_SKIP() << "another process took the port: " << server_->log();
  }
  http().send("POST", "/api/v1/jobs/" + first + "/cancel", "");
  const Answer answer = wait_for(watcher);
  EXPECT_EQ(answer.status, 0) << answer.err;
  EXPECT_EQ(Json::parse(answer.out)["state"], "succeeded");
}

// The client uploads files of every scene format. The server reads them, and the jobs succeed.
TEST_F(Client, SubmitsEverySceneFormat) {
  put("square.ply",
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n");
  put("SQUARE.OBJ", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
  put("square.stl",
      "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\n"
      "endloop\nendfacet\nendsolid\n");
  put("points.xyz", "0 0 0\n1 1 0\n");
  for (const std::string name : {"square.ply", "SQUARE.OBJ", "square.stl", "points.xyz"}) {
    const Json job = run_json({"submit", name, "-r", "64", "--wait"});
    EXPECT_EQ(job["state"], "succeeded") << job;
    const size_t dot = name.find('.');
    EXPECT_THAT(job["scene"][0].get<std::string>(),
                testing::MatchesRegex(name.substr(0, dot) + "-[0-9a-f]+" + name.substr(dot)));
  }
}

// Commands that fail have the exit statuses of docs/errors.md.
TEST_F(Client, ReportsErrors) {
  expect_error(3, "no ", {"watch", "0123456789abcdef"});
  expect_error(2, "16 hex digits", {"cancel", "../scenes"});
  expect_error(3, "none.glb", {"submit", "none.glb", "-r", "64"});
  expect_error(2, "power of two", {"submit", "m.glb", "-r", "100"});
  put("text.doc", "no scene");
  expect_error(2, "ending with .glb, .gltf, .ply, .las, .obj, .stl, .xyz, .txt or .csv",
               {"submit", "text.doc", "-r", "64"});
  expect_error(2, "text.doc", {"submit", "text.doc", "-r", "64"});
  expect_error(2, "http://", {"jobs", "--server", "ftp://127.0.0.1"});
  expect_error(6, "127.0.0.1:1", {"jobs", "--server", "http://127.0.0.1:1"});
  unsetenv("VOXDAG_SERVER");
  expect_error(2, "--server", {"jobs"});
}

// The service has a token file, so a request without a token is refused. A token with the role read
// may list jobs but not submit them. A token with the role submit may submit.
TEST_F(Client, SendsAToken) {
  std::string lines;
  for (const std::string role : {"read", "submit"}) {
    const Answer made = run({"token", "--role", role, "--name", "anna"});
    ASSERT_EQ(made.status, 0) << made.err;
    lines += made.out;
    put(role, made.err.substr(made.err.rfind(' ') + 1));
  }
  put("tokens", lines);
  ASSERT_EQ(server_->stop(), 0);
  start_server({"--tokens", folder_.file("tokens")});
  ASSERT_NE(server_->url(), "") << server_->log();
  expect_error(2, "unauthorized", {"jobs"});
  expect_error(3, "missing", {"jobs", "--token-file", "missing"});
  EXPECT_EQ(run({"jobs", "--token-file", "read"}).status, 0);
  expect_error(2, "forbidden", {"submit", "/m.glb", "-r", "64", "--token-file", "read"});
  const Answer answer = run({"submit", "m.glb", "-r", "64", "--token-file", "submit", "--wait"});
  EXPECT_EQ(answer.status, 0) << answer.err;
}

// The exit status of health is 0 if the service is ready, and 6 if it is not. Without a service the
// command fails within three seconds.
TEST_F(Client, Health) {
  const Answer answer = run({"health"});
  EXPECT_EQ(answer.status, 0) << answer.err;
  EXPECT_EQ(answer.out, server_->url() + ": ready\n");
  put("full.json", R"({"jobs": {"min_free_disk": "1000TiB"}})");
  start_server({"--config", folder_.file("full.json")});
  expect_error(6, "expected at least jobs.min_free_disk", {"health"});
  const std::string url = server_->url();
  EXPECT_EQ(server_->stop(), 0);
  server_.reset();
  const auto start = std::chrono::steady_clock::now();
  expect_error(6, url, {"health", "--server", url});
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(3));
}

}  // namespace
}  // namespace command_line
