#include "server/service.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <thread>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/field.h"
#include "server/api/answers/public_problem.h"
#include "server/api/routes/routes.h"
#include "server/disk/data_folder.h"
#include "server/http/connection/listener.h"

namespace voxdag::server {
namespace {

constexpr std::chrono::minutes kCleanUpInterval{10};
constexpr double kMaxIdleOfViewsS = 600;
constexpr size_t kMaxLoggedChars = 200;

ServerConfig checked(ServerConfig config, FileSystem& files, const Log& log) {
  check_config(config);
  files.make_directories(config.data_folder);
  // At least half of the file descriptors must be left for jobs, transfers and databases.
  const uint64_t sockets = max_open_files() / 2;
  if (config.http.limits.max_connections > sockets) {
    log({"connections are limited to " + std::to_string(sockets) + ", not " +
             std::to_string(config.http.limits.max_connections) +
             ", because they may use half of the open files of this process (ulimit -n, "
             "LimitNOFILE)",
         LogLevel::kWarning});
    config.http.limits.max_connections = sockets;
  }
  return config;
}

std::unique_ptr<FileLock> lock_folder(FileSystem& files, const std::string& folder) {
  auto lock = files.try_lock(folder + "/lock");
  if (!lock)
    throw Error(ErrorCode::kInvalidInput, folder +
                                              ": another service uses this data folder: expected a "
                                              "data folder that no other service uses");
  return lock;
}

// Removes the folders of dry runs (plans) that a crashed service left behind.
void remove_plans(FileSystem& files, const ServerConfig& config) {
  const std::string folder = config.data_folder + "/plans";
  if (!files.exists(folder)) return;
  for (const DirectoryEntry& entry : files.list(folder))
    if (entry.is_directory && files.exists(folder + "/" + entry.name + "/task.json"))
      remove_tree(files, folder + "/" + entry.name);
}

// Returns the path of a request for the log. Percent-encodes all bytes except visible ASCII
// characters, so that a path cannot write control codes of a terminal to the log. Cuts the text
// after kMaxLoggedChars characters and appends "...".
std::string shown(const std::string& path) {
  std::string text;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_visible = byte > ' ' && byte < 0x7f;
    const std::string piece = is_visible ? std::string(1, c) : "%" + hex_text({&byte, 1});
    if (text.size() + piece.size() > kMaxLoggedChars) return text + "...";
    text += piece;
  }
  return text;
}

}  // namespace

Service::Service(ServerConfig config, FileSystem& files, Log log)
    : config_(checked(std::move(config), files, log)),
      files_(files),
      log_([log = std::move(log)](const LogEntry& entry) { log(printable_entry(entry)); }),
      steps_(log_, config_.before_step),
      lock_(lock_folder(files, config_.data_folder)),
      disk_(files, config_.data_folder, config_.jobs.min_free_disk_bytes),
      access_(config_, files),
      queue_(config_.data_folder + "/queue.db",
             config_.adopt || !has_entries(files, config_.data_folder + "/jobs")),
      scenes_(files, config_.data_folder + "/scenes", log_, config_.adopt),
      clock_(std::max(queue_.last_event_s(), scenes_.last_change_s())),
      tasks_(config_, scenes_),
      http_(
          config_.http, [this](Request& request) { return answer(request); },
          [this](const Request* request, int status) {
            if (request)
              record(*request, status);
            else
              metrics_.count_request(status, 0);
          }),
      webhooks_(config_, files, queue_, log_),
      dispatcher_(config_, files, queue_, tasks_, disk_, log_,
                  [this](const Job& job) { metrics_.count_run(job); }),
      context_{config_, files,       queue_,    scenes_,  tasks_,
               disk_,   dispatcher_, webhooks_, metrics_, draining_} {
  if (!config_.token_file.empty() && config_.http.certificate_file.empty() &&
      !is_loopback_name(config_.http.address))
    log_(
        {"warning: tokens travel in plain text: " + url() +
             " is open to the network without TLS. Use --certificate and --key, or a reverse proxy",
         LogLevel::kWarning});
  steps_.run("remove the folders of old plans", [this] { remove_plans(files_, config_); });
  add_job_routes(router_);
  add_result_routes(router_);
  add_export_routes(router_);
  add_job_tile_routes(router_);
  add_event_routes(router_);
  add_scene_routes(router_);
  add_system_routes(router_);
  add_asset_routes(router_, "index.html", joined(config_.embed_origins, " "));
  add_document_route(router_);
}

std::string Service::url() const {
  const std::string& host = config_.http.address;
  return (config_.http.certificate_file.empty() ? "http://" : "https://") +
         (host.find(':') == std::string::npos ? host : '[' + host + ']') + ":" +
         std::to_string(port());
}

void Service::run() {
  // This thread cleans up until the service stops. Then it stops the builds, while http_.run()
  // still waits for requests in progress.
  std::thread cleaner([this] {
    clean_up_periodically();
    dispatcher_.stop();
    webhooks_.stop();
  });
  std::exception_ptr failure;
  try {
    http_.run(config_.drain_timeout_s);
  } catch (...) {
    failure = std::current_exception();
  }
  stop();
  cleaner.join();
  if (failure) std::rethrow_exception(failure);
}

void Service::stop() {
  {
    std::lock_guard lock(stop_mutex_);
    draining_ = true;
  }
  context_.stopping.cancel();
  stop_wake_.notify_all();
  queue_.announce();  // wakes event streams
  http_.stop();
}

void Service::clean_up_periodically() {
  while (!draining_) {
    steps_.run("remove old uploads", [this] {
      scenes_.remove_stale_uploads(clock_.oldest_s(config_.retention.upload_days, "upload", log_));
    });
    steps_.run("finish removals of scenes", [this] { scenes_.finish_removals(); });
    steps_.run("close files that nobody views",
               [this] { context_.open_sources.close_stale(kMaxIdleOfViewsS); });
    steps_.run("forget running jobs that nobody views",
               [this] { context_.partial.close_stale(kMaxIdleOfViewsS); });
    steps_.run("restore the ballast", [this] { disk_.restore_ballast(); });
    std::unique_lock lock(stop_mutex_);
    stop_wake_.wait_for(lock, kCleanUpInterval, [this] { return draining_.load(); });
  }
}

Response Service::answer(Request& request) {
  Response response;
  try {
    if (config_.before_step) config_.before_step("answer " + request.method);
    if (access_.cross_origin().is_preflight(request)) {
      access_.admit(request, Role::kNone);
      response = CrossOrigin::preflight_response();
    } else {
      response = router_.route(request, access_);
    }
  } catch (const std::exception& error) {
    const Problem problem = public_problem(error);
    if (problem.detail != error.what())  // clients do not receive this text
      log_({"request " + request.id + " " + request.method + " failed: " + error.what(),
            LogLevel::kError});
    if (!problem.log_text.empty())
      log_({"request " + request.id + " " + request.method + " failed: " + problem.log_text,
            LogLevel::kError});
    response = problem_response(problem);
  } catch (...) {
    log_({"request " + request.id + " " + request.method + " failed: an unknown exception",
          LogLevel::kError});
    response = problem_response(public_problem(std::exception()));
  }
  access_.cross_origin().add_headers(request, response);
  if (!router_.is_documented(request, response.status))
    log_({"request " + request.id + " " + request.method +
              ": the OpenAPI document lacks the status " + std::to_string(response.status),
          LogLevel::kError});
  return response;
}

void Service::record(const Request& request, int status) {
  const double duration_s = wall_seconds() - request.begin_s;
  metrics_.count_request(status, duration_s);
  const bool is_read =
      request.method == "GET" || request.method == "HEAD" || request.method == "OPTIONS";
  if (is_read && !config_.access_log) return;
  const LoggedRequest logged{.id = request.id,
                             .method = request.method,
                             .path = shown(request.target.path),
                             .status = status,
                             .who = request.caller.empty() ? "-" : request.caller,
                             .from = request.peer,
                             .duration_s = duration_s};
  LogEntry entry((is_read ? "access " : "audit ") + logged.method + " " + logged.path +
                 " status=" + std::to_string(status) + " who=" + logged.who +
                 " from=" + logged.from + " request=" + logged.id);
  entry.request = logged;
  log_(entry);
}

}  // namespace voxdag::server
