#include <algorithm>
#include <cstdio>

#include "cli/option_fields.h"
#include "cli/output.h"
#include "cli/service/follow.h"
#include "cli/service/job_text.h"
#include "cli/terminal/progress_bar.h"
#include "client/scene_upload.h"
#include "core/base/text/printable.h"
#include "core/fields/json_fields.h"
#include "core/io/random_id.h"
#include "scheduler/check_spec.h"
#include "server/jobs/protocol/job_request.h"

namespace voxdag::cli {
namespace {

struct SubmitCommand {
  server::JobRequest request;
  ServiceOptions service;
  bool wait = false;
  bool quiet = false;
  bool json = false;
};

// Uploads the scenes that are local files. Returns the name of every scene on the server. A scene
// that is not a local file must already be on the server.
std::vector<std::string> upload(const std::vector<std::string>& scenes, FileSystem& files,
                                ServiceClient& service, bool quiet) {
  const auto progress = make_progress_bar(quiet);
  std::vector<std::string> names;
  for (const std::string& scene : scenes)
    names.push_back(files.exists(scene) ? client::upload_scene(service, files, scene, *progress)
                                        : scene);
  return names;
}

// Without --resolution, finds the resolution for --voxel-size, as `build` does. Reads the scene on
// this machine, so all of its files must be local.
void find_resolution(server::JobRequest& request, CommandContext& context, bool quiet) {
  GeometryOptions& geometry = request.spec.geometry;
  if (geometry.resolution > 0) return;
  // Run options of the request, such as --memory, are for the server.
  BuildSpec local{geometry, {}};
  local.geometry.scenes = request.scenes;
  for (const std::string& scene : request.scenes)
    if (geometry.voxel_size && !context.files.exists(scene))
      throw Error(
          ErrorCode::kInvalidInput,
          "--voxel-size was given without --resolution: expected both, because the scene '" +
              scene + "' is not on this machine, so this command cannot find its extent");
  const auto progress = make_progress_bar(quiet);
  geometry.resolution = with_option_names([&] {
    return checked(with_resolution(local, {context.files, *progress, context.cancel}))
        .geometry.resolution;
  });
}

// Throws before the upload if the server would refuse the labels.
void check_labels(const std::vector<std::string>& labels) {
  if (labels.empty() || fits(server::kLabelsField, labels)) return;
  const auto wrong = std::ranges::find_if(labels, [](const std::string& label) {
    return !fits(server::kLabelsField, std::vector<std::string>{label});
  });
  const std::string count = std::to_string(labels.size());
  const std::string what =
      wrong == labels.end() ? count + " items"
                            : "item " + std::to_string(wrong - labels.begin() + 1) + " of " + count;
  throw Error(ErrorCode::kInvalidInput,
              "--label: " + what + ": expected " +
                  expectation<std::vector<std::string>>(server::kLabelsField));
}

void run(const SubmitCommand& command, ServiceClient& service, CommandContext& context) {
  server::JobRequest request = command.request;
  check_labels(request.labels);
  find_resolution(request, context, command.quiet);
  request.scenes = upload(request.scenes, context.files, service, command.quiet);
  const Json body = options_json(request);
  // Idempotency key: if the answer is lost and the request is sent again, the server creates no
  // second job.
  const std::string key = random_id() + random_id();
  Json job = service.post("/api/v1/jobs", body, {{"Idempotency-Key", key}});
  if (!command.json)
    std::printf("%s\n%s/#/jobs/%s\n", state_line(job).c_str(), service.url().c_str(),
                printable_line(job.at("id").get<std::string>()).c_str());
  std::fflush(stdout);
  if (command.wait) job = follow_job(service, job.at("id"), command.quiet);
  if (command.json) print_json(job);
  if (!command.wait) return;
  check_succeeded(job);
  if (!command.json && !command.quiet) print_result(job);
}

void declare(Command& command, SubmitCommand& state) {
  OptionDeclarer options(command, Scope::kSubmit);
  fields(options, state.request);
  options.at("resolution").optional();  // --voxel-size can replace it
  command.config_option();
  state.service.declare(command);
  command.flag("--wait", state.wait, "follow the job until it ends, as watch does");
  command.quiet_flag(state.quiet, "print only the job's id and address, warnings and errors");
  command.json_flag(state.json, "the job as one JSON object on standard output");
}

}  // namespace

void add_submit_command(CommandLine& line) {
  add_service_command<SubmitCommand>(line, "submit", "build a scene on a server");
}

}  // namespace voxdag::cli
