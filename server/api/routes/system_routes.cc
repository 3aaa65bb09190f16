// Health, readiness, version and metrics.
#include <unistd.h>

#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/fields/json_text.h"
#include "server/api/answers/public_problem.h"
#include "server/api/context/context.h"
#include "server/api/routes/routes.h"

namespace voxdag::server {
namespace {

// Tests whether the data folder is writable, at most once per second. Thread-safe.
class WriteProbe {
 public:
  // Creates and removes a file in the data folder, unless a call has succeeded within the last
  // second. Throws Error if the folder is not writable.
  void check(Context& context) {
    const std::lock_guard lock(mutex_);
    if (wall_seconds() < valid_until_s_) return;
    const std::string probe = context.config.data_folder + "/.ready-" + std::to_string(getpid());
    context.files.create(probe)->close();
    context.files.remove(probe);
    valid_until_s_ = wall_seconds() + 1;
  }

 private:
  std::mutex mutex_;
  double valid_until_s_ = 0;
};

// Calls `check`. Throws Problem (503) with the text `failure` if `check` throws Error.
template <class Check>
void expect_ready(const char* failure, const Check& check) {
  try {
    check();
  } catch (const Error&) {
    throw busy(failure, 60);
  }
}

Response get_ready(Context& context, WriteProbe& probe) {
  if (context.draining) throw busy("the service is stopping: expected a request after its restart");
  expect_ready("the free space of the data folder's disk cannot be determined", [&] {
    if (context.disk.is_low())
      throw busy("the disk has " + size_text(context.disk.free()) +
                     " free: expected at least jobs.min_free_disk of the configuration",
                 60);
  });
  expect_ready(
      "queue.db in the data folder was removed or replaced while the service used it: restore it "
      "and restart the service",
      [&] { context.queue.check_file(); });
  expect_ready(
      "scenes/scenes.db in the data folder was removed or replaced while the service used it: "
      "restore it and restart the service",
      [&] { context.scenes.check_file(); });
  expect_ready("the queue's database, queue.db in the data folder, cannot be read",
               [&] { context.queue.counts(); });
  expect_ready("the data folder is not writable: a new file could not be created in it",
               [&] { probe.check(context); });
  return json_response(200, "{\"status\":\"ready\"}");
}

std::string state_label(const char* state) { return "state=\"" + std::string(state) + "\""; }

void add_exports(const auto& add, const Exports::Statistics& exports) {
  for (size_t i = 0; i < exports.exports.size(); ++i)
    add("voxdag_exports", "Exports of jobs' results by state.", exports.exports[i],
        state_label(name_of(static_cast<ExportState>(i))));
  for (const ExportState state : {ExportState::kQueued, ExportState::kDeleting,
                                  ExportState::kFailed, ExportState::kSucceeded})
    add("voxdag_export_runs_total", "Ended runs of exports by the state they left the export in.",
        exports.ended_runs[static_cast<size_t>(state)], state_label(name_of(state)));
  add("voxdag_exported_bytes_total", "File bytes of succeeded exports.", exports.ended_bytes);
  add("voxdag_export_wall_seconds_total", "Wall time of ended runs of exports.",
      exports.ended_wall_s);
}

void add_webhooks(const auto& add, const Webhooks::Statistics& webhooks) {
  add("voxdag_webhook_pending_deliveries", "Deliveries of webhooks that have not ended.",
      webhooks.pending);
  add("voxdag_webhook_attempts_total", "Ended attempts to deliver a webhook.", webhooks.attempts);
  constexpr const char* kHelp = "Ended deliveries of webhooks by their final state.";
  add("voxdag_webhook_deliveries_total", kHelp, webhooks.delivered, state_label("delivered"));
  add("voxdag_webhook_deliveries_total", kHelp, webhooks.failed, state_label("failed"));
}

Response get_metrics(Context& context, double started_s) {
  std::vector<Sample> samples;
  const auto add = [&](const char* name, const char* help, auto value, std::string labels = "") {
    samples.push_back({name, help, static_cast<double>(value), std::move(labels)});
  };
  add("voxdag_job_processes", "Running job processes.", context.dispatcher.running());
  add("voxdag_event_streams", "Open event streams.", context.event_streams.in_use());
  add("voxdag_transfers", "Uploads and downloads in progress.",
      context.uploads.in_use() + context.downloads.in_use());
  add("voxdag_free_disk_bytes", "Free disk space for the data folder.", context.disk.free());
  add("voxdag_job_memory_limit_bytes", "Memory limit of all running jobs together.",
      context.tasks.memory_bytes());
  const ClusterTasks tasks = context.dispatcher.cluster_tasks();
  uint64_t running = 0;
  for (const auto& [node, count] : tasks.running) running += count;
  add("voxdag_cluster_tasks_running", "Tasks of running jobs that run on the cluster.", running);
  add("voxdag_cluster_tasks_waiting", "Tasks of running jobs that wait for the cluster.",
      tasks.waiting);
  add("voxdag_cluster_nodes", "Nodes of the cluster on which tasks run.", tasks.running.size());
  add("voxdag_cluster_failed_attempts", "Failed attempts of the batches of running jobs.",
      tasks.failed_attempts);
  add_exports(add, context.dispatcher.exports().statistics());
  add_webhooks(add, context.webhooks.statistics());
  add("voxdag_resident_memory_bytes", "Resident memory of the service without its jobs.",
      resident_bytes());
  add("voxdag_cpu_seconds_total", "CPU time of the service without its jobs.",
      process_cpu_seconds());
  add("voxdag_uptime_seconds", "Time since the service started.", wall_seconds() - started_s);
  return make_response(200, "text/plain; version=0.0.4; charset=utf-8", "no-store",
                       context.metrics.text(context.queue.counts(), std::move(samples)));
}

Response get_machine(Context& context, double started_s) {
  const nlohmann::ordered_json json = {
      {"version", VOXDAG_VERSION},
      {"cores", default_threads()},
      {"job_memory_bytes", context.tasks.memory_bytes()},
      {"max_concurrent_jobs", context.config.jobs.max_concurrent},
      {"running_jobs", context.dispatcher.running()},
      {"free_disk_bytes", context.disk.free()},
      {"min_free_disk_bytes", context.config.jobs.min_free_disk_bytes},
      {"uptime_s", wall_seconds() - started_s}};
  return json_response(200, exact_json_text(json));
}

}  // namespace

void add_system_routes(Router& router) {
  const auto add = [&](const std::string& path, Role role, const std::string& id,
                       const std::string& summary, Answer answer, Router::Handler handler) {
    router.add({.method = "GET",
                .pattern = path,
                .role = role,
                .id = id,
                .summary = summary,
                .tag = "service",
                .accepts_any_query = true,
                .answers = {std::move(answer)}},
               std::move(handler));
  };
  add("/healthz", Role::kNone, "health", "Liveness check", {200, "ok", {json_content()}},
      [](Context&, Call&) { return json_response(200, "{\"status\":\"ok\"}"); });
  add("/readyz", Role::kNone, "ready", "Readiness check", {200, "ready", {json_content()}},
      [probe = std::make_shared<WriteProbe>()](Context& context, Call&) {
        return get_ready(context, *probe);
      });
  add("/version", Role::kNone, "version", "Versions of the program and the API",
      {200, "versions", {json_content()}}, [](Context&, Call&) {
        return json_response(200, "{\"version\":\"" VOXDAG_VERSION "\",\"api\":\"v1\"}");
      });
  add("/api/v1/machine", Role::kRead, "machine", "The machine and its limits for jobs",
      {200, "the machine", {json_content("Machine")}},
      [started_s = wall_seconds()](Context& context, Call&) {
        return get_machine(context, started_s);
      });
  add("/metrics", Role::kRead, "metrics", "Metrics in the Prometheus text format",
      {200, "metrics", {{"text/plain"}}}, [started_s = wall_seconds()](Context& context, Call&) {
        return get_metrics(context, started_s);
      });
}

}  // namespace voxdag::server
