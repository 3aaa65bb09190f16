#include <cstdio>

#include "cli/build_options.h"
#include "cli/output.h"
#include "cli/service/follow.h"
#include "cli/service/job_text.h"
#include "cli/terminal/progress_bar.h"
#include "client/scene_upload.h"
#include "core/io/random_id.h"

namespace voxdag::cli {
namespace {

struct SubmitCommand {
  BuildOptions build;
  ServiceOptions service;
  std::string name;
  int priority = 0;
  bool wait = false;
  bool json = false;
};

// The options of the command line in the form of the API.
Json options_json(const BuildSpec& spec) {
  const GeometryOptions& g = spec.geometry;
  const RunOptions& r = spec.run;
  Json options = Json::object();
  if (g.bounds) options["bounds"] = *g.bounds;
  if (g.voxel_size) options["voxel_size"] = *g.voxel_size;
  if (g.skip_invalid) options["skip_invalid"] = true;
  if (g.hash_bits != GeometryOptions{}.hash_bits) options["hash_bits"] = g.hash_bits;
  if (g.attributes.has(Attribute::kColor)) options["color"] = true;
  const AttributeSet others = g.attributes.without(Attribute::kColor);
  if (others.any()) options["attributes"] = others.names();
  if (g.color_resolution != 0) options["color_resolution"] = g.color_resolution;
  if (r.memory_bytes != 0) options["memory"] = r.memory_bytes;
  if (r.threads != 0) options["threads"] = r.threads;
  if (r.subvolume_edge != 0) options["subvolume"] = r.subvolume_edge;
  if (r.backend != RunOptions{}.backend) options["backend"] = r.backend;
  if (!r.method.empty()) options["method"] = r.method;
  return options;
}

// Uploads scenes that are local files; other names are scenes of the server.
Json scenes_json(const std::vector<std::string>& scenes, FileSystem& files,
                 ServiceClient& service) {
  const auto progress = make_progress_bar();
  Json names = Json::array();
  for (const std::string& scene : scenes)
    names.push_back(files.exists(scene) ? client::upload_scene(service, files, scene, *progress)
                                        : scene);
  return names;
}

void run(const SubmitCommand& command, ServiceClient& service, CommandContext& context) {
  const BuildSpec spec = command.build.spec();
  Json body = {{"scene", scenes_json(spec.geometry.scenes, context.files, service)},
               {"resolution", spec.geometry.resolution},
               {"options", options_json(spec)}};
  if (!command.name.empty()) body["name"] = command.name;
  if (command.priority != 0) body["priority"] = command.priority;
  // A retry after a lost answer must not create a second job.
  const std::string key = random_id() + random_id();
  Json job = service.post("/api/v1/jobs", body, {{"Idempotency-Key", key}});
  if (!command.json) std::printf("%s\n", state_line(job).c_str());
  std::fflush(stdout);
  if (command.wait) job = follow_job(service, job.at("id"));
  if (command.json) print_json(job);
  if (!command.wait) return;
  check_succeeded(job);
  if (!command.json) print_result(job);
}

void declare(Command& command, SubmitCommand& state) {
  state.build.declare(command);
  state.service.declare(command);
  command.option("--name", state.name, "name of the job, for people");
  command.option("--priority", state.priority, "-100 to 100; higher runs earlier");
  command.flag("--wait", state.wait, "follow the job until it ends, as watch does");
  command.json_flag(state.json, "the job as one JSON object on standard output");
}

}  // namespace

void add_submit_command(CommandLine& line) {
  add_service_command<SubmitCommand>(line, "submit", "build a scene on a server");
}

}  // namespace voxdag::cli
