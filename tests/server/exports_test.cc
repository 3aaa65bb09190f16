// Exports of a job's result through the API.
#include <filesystem>

#include "core/format/checksum.h"
#include "server/api/access/tokens.h"
#include "tests/server/running_service.h"

namespace voxdag::server {
namespace {

using namespace std::string_literals;

class ServiceExports : public RunningService {
 protected:
  // Makes the processes of exports wait until go().
  void hold_exports() {
    write_file_atomically(system_files(), folder_.file("program"),
                          "#!/bin/sh\ncase \"$2\" in */exports/*)\n  : > \"" +
                              folder_.file("held") + "\"\n  while [ ! -e \"" + folder_.file("go") +
                              "\" ]; do sleep 0.05; done\nesac\nexec " + VOXDAG_BINARY +
                              " \"$@\"\n");
    std::filesystem::permissions(folder_.file("program"), std::filesystem::perms::owner_all);
    config_.program = folder_.file("program");
  }
  bool until_held() {
    return until([&] { return std::filesystem::exists(folder_.file("held")); });
  }
  void go() { write_file_atomically(system_files(), folder_.file("go"), ""); }

  // Builds a job and returns its id.
  std::string finished_job() {
    EXPECT_EQ(put_scene("m.glb", scene_bytes()).status, 201);
    const std::string id = post_job({{"scene", "m.glb"}, {"resolution", 64}, {"name", "my job"}});
    EXPECT_TRUE(until_state(id, "succeeded"));
    return id;
  }
  static std::string exports_of(const std::string& id) { return "/api/v1/jobs/" + id + "/exports"; }
  // Posts a request, expects that it is queued, and returns the path of the export.
  std::string queued_export(const std::string& id, const Json& request) {
    const ClientResponse response = post(exports_of(id), request);
    EXPECT_EQ(response.status, 202) << response.body;
    return Json::parse(response.body).at("links").at("self");
  }
  Json shown(const std::string& path) { return Json::parse(http_->get(path).body); }
  Json ended(const std::string& path) {
    EXPECT_TRUE(until([&] {
      const std::string state = shown(path).value("state", "");
      return state == "succeeded" || state == "failed";
    }));
    return shown(path);
  }
  std::string folder_of(const std::string& export_path) {
    return config_.data_folder + export_path.substr(std::string("/api/v1").size());
  }
  std::string contents(const std::string& path) {
    return read_small_file(system_files(), path, uint64_t{1} << 30);
  }
  // Runs a command of voxdag with the result of the job as its input.
  void run_locally(const std::string& id, const std::string& command, const std::string& options) {
    const std::string line = std::string(VOXDAG_BINARY) + " " + command + " " +
                             config_.data_folder + "/jobs/" + id + "/result.vdag " + options +
                             " >/dev/null 2>&1";
    ASSERT_EQ(std::system(line.c_str()), 0) << line;
  }
};

TEST_F(ServiceExports, HaveTheBytesOfLocalExports) {
  start();
  const std::string id = finished_job();
  struct Case {
    Json request;
    std::string command, options, name, second;
  };
  const std::vector<Case> cases = {
      {{{"to", "npz"}, {"level", 5}}, "export", "--to npz --level 5", "my-job-32.npz", ""},
      {{{"to", "glb"}, {"level", 5}, {"up", "z"}, {"outside", true}},
       "export",
       "--to glb --level 5 --up z --outside",
       "my-job-32.glb",
       ""},
      {{{"to", "hashdag"}},
       "export",
       "--to hashdag",
       "my-job-64.basic_dag.dag.bin",
       "my-job-64.basic_dag.uncompressed_colors.bin"},
      {{{"to", "vdag"}, {"region", {0, 0, 0, 20, 20, 20}}, {"crop", true}},
       "extract",
       "--region 0,0,0,20,20,20 --crop",
       "my-job-64-part.vdag",
       ""}};
  std::filesystem::create_directory(folder_.file("local"));
  for (const Case& each : cases) {
    SCOPED_TRACE(each.request.dump());
    const std::string path = queued_export(id, each.request);
    const Json done = ended(path);
    ASSERT_EQ(done["state"], "succeeded") << done.dump(2);
    run_locally(id, each.command, each.options + " -o " + folder_.file("local/" + each.name));
    ASSERT_EQ(done["files"].size(), each.second.empty() ? 1u : 2u);
    for (const Json& file : done["files"]) {
      const std::string expected =
          contents(folder_.file("local/" + file.at("name").get<std::string>()));
      const ClientResponse got = http_->get(file.at("href"));
      EXPECT_TRUE(got.body == expected) << "the bytes differ from those of the local command";
      EXPECT_EQ(file.at("bytes"), expected.size());
      EXPECT_EQ(got.header("ETag"), '"' + sha256_hex(expected) + '"');
    }
    EXPECT_EQ(done["files"][0]["name"], each.name);
    EXPECT_EQ(done["request"], each.request);
    EXPECT_EQ(done["error"], nullptr);
    const std::string file = done["files"][0]["href"];
    EXPECT_EQ(http_->get(file, {{"Range", "bytes=3-8"}}).body, http_->get(file).body.substr(3, 6));
    EXPECT_NE(http_->get(file).header("Content-Disposition").find(each.name), std::string::npos);
    EXPECT_EQ(http_->get(path + "/files/9").status, 404);
    // The same request again returns the same export.
    const ClientResponse again = post(exports_of(id), each.request);
    EXPECT_EQ(again.status, 200);
    EXPECT_EQ(Json::parse(again.body)["id"], done["id"]);
  }
  EXPECT_EQ(shown(exports_of(id))["exports"].size(), cases.size());

  uint64_t bytes = 0;
  const Json all = shown(exports_of(id));
  for (const Json& each : all["exports"])
    for (const Json& file : each["files"]) bytes += file["bytes"].get<uint64_t>();
  const std::string metrics = http_->get("/metrics").body;
  for (const std::string& line :
       {"# TYPE voxdag_exports gauge\nvoxdag_exports{state=\"queued\"} 0\n"
        "voxdag_exports{state=\"running\"} 0\nvoxdag_exports{state=\"deleting\"} 0\n"
        "voxdag_exports{state=\"failed\"} 0\nvoxdag_exports{state=\"succeeded\"} 4\n"s,
        "voxdag_export_runs_total{state=\"failed\"} 0\n"s,
        "voxdag_export_runs_total{state=\"succeeded\"} 4\n"s,
        "voxdag_exported_bytes_total " + std::to_string(bytes) + "\n"})
    EXPECT_NE(metrics.find(line), std::string::npos) << line << "is not in\n" << metrics;
}

// The middle of the scene, a Menger sponge, is empty.
TEST_F(ServiceExports, HaveTheWarningsOfLocalExtracts) {
  start();
  const std::string id = finished_job();
  const auto extract = [&](const Json& region) {
    return ended(queued_export(id, {{"to", "vdag"}, {"region", region}}));
  };
  const Json empty = extract({30, 30, 30, 34, 34, 34});
  EXPECT_EQ(empty["voxels"], 0) << empty;
  EXPECT_EQ(empty["warnings"],
            Json::array({"the selection has no voxels: the file will have no nodes"}));
  EXPECT_EQ(empty["notes"], Json::array());
  EXPECT_EQ(extract({0, 0, 0, 64, 64, 64})["warnings"], Json::array());
}

// If files were removed from the service's disk, the advice depends on the removed file. A new job
// is not needed for an export whose result still exists.
TEST_F(ServiceExports, AdviseWhatToDoAboutRemovedFiles) {
  start();
  const std::string id = finished_job();
  const Json request = {{"to", "npz"}, {"level", 5}};
  const std::string path = queued_export(id, request);
  const Json done = ended(path);
  const std::string file = done["files"][0]["href"];
  std::filesystem::remove(folder_of(path) + "/" + done["files"][0]["name"].get<std::string>());
  const ClientResponse removed = http_->get(file);
  EXPECT_EQ(removed.status, 404);
  EXPECT_NE(removed.body.find("; delete the export and request it again"), std::string::npos)
      << removed.body;
  EXPECT_EQ(removed.body.find("new job"), std::string::npos) << removed.body;
  // The advice works.
  EXPECT_EQ(http_->send("DELETE", path, "").status, 204);
  const Json again = ended(queued_export(id, request));
  EXPECT_EQ(http_->get(again["files"][0]["href"]).status, 200) << again;

  std::filesystem::remove(config_.data_folder + "/jobs/" + id + "/result.vdag");
  for (const ClientResponse& response :
       {http_->get("/api/v1/jobs/" + id + "/dag"), post(exports_of(id), {{"to", "glb"}})}) {
    EXPECT_EQ(response.status, 404);
    EXPECT_NE(response.body.find("the result of the job " + id + " was removed"), std::string::npos)
        << response.body;
    EXPECT_NE(response.body.find("; submit a new job of the scene"), std::string::npos)
        << response.body;
  }
}

TEST_F(ServiceExports, RefuseWrongRequests) {
  config_.exports.max_per_job = 1;
  start();
  const std::string id = finished_job();
  const std::pair<Json, std::string> cases[] = {
      {{{"level", 5}}, "to"},
      {{{"to", "fbx"}}, "expected one of vdag, hashdag"},
      {{{"to", "npz"}, {"chunks", 64}}, "chunks"},
      {{{"to", "npz"}, {"outside", true}}, "glb"},
      {{{"to", "npz"}, {"crop", true}}, "'crop': expected 'to' to be vdag, not npz"},
      {{{"to", "vdag"}, {"gray", true}},
       "'gray': expected 'to' to be a format of voxdag export, not vdag"},
      {{{"to", "npz"}, {"level", 7}}, "'level' is 7: expected 2 to 6"},
      {{{"to", "npz"}, {"level", 1}}, "'level'"},
      {{{"to", "npz"}, {"region", {0, 0, 0, 4, 4}}}, "'region': expected 6"},
      {{{"to", "npz"}, {"region", {0, 0, 0, 4, 4, 0}}}, "X0 < X1"},
      {{{"to", "npz"}, {"region", {0, 0, 0, 4, 4, 0.5}}}, "whole numbers"},
      {{{"to", "npz"}, {"region", {64, 0, 0, 70, 4, 4}}}, "outside the grid of 64"},
      {{{"to", "npz"}, {"world", true}}, "'world'"}};
  for (const auto& [request, text] : cases) {
    SCOPED_TRACE(request.dump());
    const ClientResponse refused = post(exports_of(id), request);
    EXPECT_EQ(not_problem(refused, 400, "invalid_input"), "");
    EXPECT_NE(refused.body.find(text), std::string::npos) << refused.body;
    EXPECT_EQ(refused.body.find(folder_.path()), std::string::npos) << refused.body;
  }
  EXPECT_EQ(post(exports_of("0123456789abcdef"), {{"to", "npz"}}).status, 404);
  const std::string other = post_job({{"scene", "m.glb"}, {"resolution", 16384}});
  const ClientResponse early = post(exports_of(other), {{"to", "npz"}});
  EXPECT_EQ(not_problem(early, 404, "not_found"), "") << "the job has not succeeded";
  post("/api/v1/jobs/" + other + "/cancel");
  queued_export(id, {{"to", "npz"}, {"level", 3}});
  const ClientResponse more = post(exports_of(id), {{"to", "npz"}, {"level", 4}});
  EXPECT_EQ(not_problem(more, 422, "limit"), "");
}

// Messages name members of the request, not options of the command line.
TEST_F(ServiceExports, NameMembersInMessages) {
  start();
  const std::string id = finished_job();
  const ClientResponse refused = post(exports_of(id), {{"to", "npz"}, {"watertight", true}});
  EXPECT_EQ(Json::parse(refused.body)["detail"], "'watertight': expected the format glb, not npz");
  // The center of the sponge has no voxels.
  const Json failed =
      ended(queued_export(id, {{"to", "npz"}, {"region", {30, 30, 30, 34, 34, 34}}}));
  EXPECT_EQ(failed["error"]["code"], "invalid_input") << failed.dump(2);
  const std::string message = failed["error"]["message"];
  EXPECT_NE(message.find("no voxels are selected: expected a 'region' with voxels"),
            std::string::npos)
      << message;
}

// A failed export has the code of its error, no files, and no path of the server. Here it fails
// because an extract by majority cannot keep colors. The same request queues the export again.
TEST_F(ServiceExports, ReportWhyTheyFailed) {
  start();
  put_scene("m.glb", scene_bytes());
  const std::string id =
      post_job({{"scene", "m.glb"}, {"resolution", 64}, {"options", {{"color", true}}}});
  ASSERT_TRUE(until_state(id, "succeeded"));
  const Json request = {{"to", "vdag"}, {"level", 5}, {"majority", true}};
  const std::string path = queued_export(id, request);
  const Json failed = ended(path);
  EXPECT_EQ(failed["state"], "failed");
  EXPECT_EQ(failed["error"]["code"], "invalid_input") << failed.dump(2);
  EXPECT_EQ(failed.dump().find(folder_.path()), std::string::npos) << failed.dump(2);
  EXPECT_TRUE(failed["files"].empty());
  EXPECT_EQ(http_->get(path + "/files/0").status, 404);
  EXPECT_EQ(queued_export(id, request), path);
  EXPECT_EQ(ended(path)["state"], "failed");
}

TEST_F(ServiceExports, CanBeCanceledAndRequestedAgain) {
  hold_exports();
  start();
  const std::string id = finished_job();
  const std::string running = queued_export(id, {{"to", "npz"}});
  const std::string waiting = queued_export(id, {{"to", "npz"}, {"level", 4}});
  ASSERT_TRUE(until_held());
  EXPECT_EQ(shown(running)["state"], "running");
  EXPECT_EQ(shown(waiting)["state"], "queued") << "one export runs at a time";
  EXPECT_EQ(http_->send("DELETE", waiting, "").status, 204);
  const ClientResponse canceled = http_->send("DELETE", running, "");
  EXPECT_TRUE(canceled.status == 202 || canceled.status == 204) << canceled.status;
  ASSERT_TRUE(until([&] { return http_->get(running).status == 404; }));
  for (const std::string& path : {running, waiting})
    EXPECT_FALSE(std::filesystem::exists(folder_of(path)));
  EXPECT_EQ(http_->send("DELETE", running, "").status, 404);
  go();
  const std::string again = queued_export(id, {{"to", "npz"}});
  EXPECT_EQ(ended(again)["state"], "succeeded");
  const std::string folder = folder_of(again);
  EXPECT_EQ(http_->send("DELETE", again, "").status, 204);
  EXPECT_FALSE(std::filesystem::exists(folder));
}

// A service that stops keeps its exports, and the next service runs them.
TEST_F(ServiceExports, ContinueAfterARestart) {
  hold_exports();
  start();
  const std::string id = finished_job();
  const std::string running = queued_export(id, {{"to", "npz"}});
  const std::string waiting = queued_export(id, {{"to", "npz"}, {"level", 4}});
  ASSERT_TRUE(until_held());
  stop();
  go();
  start();
  for (const std::string& path : {running, waiting}) {
    const Json done = ended(path);
    ASSERT_EQ(done["state"], "succeeded") << done.dump(2);
    EXPECT_EQ(sha256_hex(http_->get(done["files"][0]["href"]).body), done["files"][0]["sha256"]);
  }
  stop();
  start();
  EXPECT_EQ(shown(running)["state"], "succeeded") << "complete exports are kept";
}

// Queued exports run in the order of their requests, also after two restarts. The ids, which are
// the names of the exports' folders, have another order.
TEST_F(ServiceExports, KeepTheirOrderAfterARestart) {
  hold_exports();
  start();
  const std::string id = finished_job();
  std::vector<std::string> paths;
  for (const int level : {6, 2, 5, 3, 4})
    for (const char* format : {"npz", "ply"})
      paths.push_back(queued_export(id, {{"to", format}, {"level", level}}));
  ASSERT_TRUE(until_held());
  stop();
  start();
  stop();
  go();
  start();
  std::string previous;
  for (const std::string& path : paths) {
    const Json done = ended(path);
    ASSERT_EQ(done["state"], "succeeded") << done.dump(2);
    EXPECT_LT(previous, done["started_at"].get<std::string>()) << done.dump(2);
    previous = done["started_at"];
  }
}

// After a kill, the record of the export has the state "running", and a part of its file can exist.
// The next service removes the part and runs the export again. If the service ends during an export
// too often, the export fails.
TEST_F(ServiceExports, RunAgainAfterAKill) {
  start();
  const std::string id = finished_job();
  const std::string path = queued_export(id, {{"to", "npz"}});
  ASSERT_EQ(ended(path)["state"], "succeeded");
  const std::string record = folder_of(path) + "/export.json";
  const auto kill_while_running = [&](unsigned interruptions) {
    stop();
    Json stored = Json::parse(contents(record));
    stored["state"] = "running";
    stored["interruptions"] = interruptions;
    write_file_atomically(system_files(), record, stored.dump());
    write_file_atomically(system_files(), folder_of(path) + "/my-job-64.npz.partial", "part");
    std::filesystem::create_directories(folder_of(path) + "/my-job-64.vdag.work");
    // The rest of a deletion that a kill has interrupted.
    std::filesystem::create_directories(folder_.file("data/jobs/" + id + "/exports/") +
                                        "0123456789abcdef");
    start();
  };
  kill_while_running(0);
  ASSERT_EQ(ended(path)["state"], "succeeded");
  EXPECT_FALSE(std::filesystem::exists(folder_of(path) + "/my-job-64.npz.partial"));
  EXPECT_FALSE(std::filesystem::exists(folder_of(path) + "/my-job-64.vdag.work"));
  EXPECT_FALSE(
      std::filesystem::exists(folder_.file("data/jobs/" + id + "/exports/0123456789abcdef")));
  kill_while_running(3);
  const Json failed = ended(path);
  EXPECT_EQ(failed["state"], "failed");
  EXPECT_NE(failed["error"]["message"].get<std::string>().find("the service ended 4 times"),
            std::string::npos);
  EXPECT_TRUE(failed["files"].empty());
  EXPECT_FALSE(std::filesystem::exists(folder_of(path) + "/my-job-64.npz"));
}

TEST_F(ServiceExports, AreDeletedWithTheirJob) {
  hold_exports();
  start();
  const std::string id = finished_job();
  const std::string path = queued_export(id, {{"to", "npz"}});
  ASSERT_TRUE(until_held());
  EXPECT_EQ(http_->send("DELETE", "/api/v1/jobs/" + id, "").status, 204);
  EXPECT_EQ(http_->get(path).status, 404);
  EXPECT_EQ(http_->get(exports_of(id)).status, 404);
  EXPECT_FALSE(std::filesystem::exists(config_.data_folder + "/jobs/" + id));
  EXPECT_FALSE(std::filesystem::exists(config_.data_folder + "/jobs/" + id + ".deleted"));
}

// An export leaves jobs.min_free_disk bytes free.
TEST_F(ServiceExports, LeaveTheReservedDiskSpaceFree) {
  hold_exports();
  start();
  const std::string id = finished_job();
  const std::string path = queued_export(id, {{"to", "npz"}});
  ASSERT_TRUE(until_held());
  stop();
  go();
  config_.jobs.min_free_disk_bytes = uint64_t{1} << 60;
  start();
  const Json failed = ended(path);
  EXPECT_EQ(failed["state"], "failed");
  EXPECT_EQ(failed["error"]["code"], "no_space") << failed.dump(2);
  EXPECT_EQ(not_problem(post(exports_of(id), {{"to", "npz"}}), 507, "no_space"), "");
  size_t files = 0;  // not counting the record, the log, the task and the link to the result
  for (const auto& entry : std::filesystem::directory_iterator(folder_of(path)))
    files += entry.path().string().find(".npz") != std::string::npos;
  EXPECT_EQ(files, 0u);
}

// A token with the role read may list and download exports, but not request or delete them.
TEST_F(ServiceExports, ObeyRoles) {
  start();
  const std::string id = finished_job();
  const std::string path = queued_export(id, {{"to", "npz"}});
  ASSERT_EQ(ended(path)["state"], "succeeded");
  stop();
  const NewToken reader = make_token("read", "reader");
  const NewToken submitter = make_token("submit", "submitter");
  write_file_atomically(system_files(), folder_.file("tokens"),
                        reader.line + "\n" + submitter.line + "\n");
  config_.token_file = folder_.file("tokens");
  start();
  HttpClient read({url(), reader.token, "", 300}), submit({url(), submitter.token, "", 300});
  EXPECT_EQ(http_->get(path).status, 401);
  EXPECT_EQ(read.get(exports_of(id)).status, 200);
  EXPECT_EQ(read.get(path + "/files/0").status, 200);
  const std::string body = Json{{"to", "npz"}}.dump();
  EXPECT_EQ(read.send("POST", exports_of(id), body).status, 403);
  EXPECT_EQ(read.send("DELETE", path, "").status, 403);
  EXPECT_EQ(submit.send("POST", exports_of(id), body).status, 200);
  EXPECT_EQ(submit.send("DELETE", path, "").status, 204);
}

}  // namespace
}  // namespace voxdag::server
