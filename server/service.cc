#include "server/service.h"

#include <chrono>
#include <thread>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "server/api/public_problem.h"

namespace voxdag::server {
namespace {

constexpr std::chrono::minutes kCleanUpInterval{10};
constexpr double kSecondsPerDay = 86400;
constexpr size_t kMaxLoggedChars = 200;

ServerConfig checked(ServerConfig config, FileSystem& files, const Service::Log& log) {
  check_config(config);
  files.make_directories(config.data_folder);
  // Clients must not use up the files that jobs, transfers and stores need.
  const uint64_t sockets = max_open_files() / 2;
  if (config.http.limits.max_connections > sockets) {
    log("connections are limited to " + std::to_string(sockets) + ", not " +
        std::to_string(config.http.limits.max_connections) +
        ", because the process may have few open files (ulimit -n, LimitNOFILE)");
    config.http.limits.max_connections = sockets;
  }
  return config;
}

std::unique_ptr<FileLock> lock_folder(FileSystem& files, const std::string& folder) {
  auto lock = files.try_lock(folder + "/lock");
  if (!lock)
    throw Error(ErrorCode::kInvalidInput, folder + ": another service uses this data folder");
  return lock;
}

}  // namespace

Service::Service(ServerConfig config, FileSystem& files, Log log)
    : config_(checked(std::move(config), files, log)),
      files_(files),
      log_(std::move(log)),
      lock_(lock_folder(files, config_.data_folder)),
      access_(config_, files),
      queue_(config_.data_folder + "/queue.db"),
      scenes_(files, config_.data_folder + "/scenes"),
      tasks_(config_, scenes_),
      http_(config_.http, [this](Request& request) { return answer(request); }),
      dispatcher_(config_, files, queue_, tasks_, log_,
                  [this](const Job& job) { metrics_.count_run(job); }),
      context_{config_, files, queue_, scenes_, tasks_, dispatcher_, metrics_, draining_} {
  remove_tree(files_, config_.data_folder + "/plans");
  add_job_routes(router_);
  add_result_routes(router_);
  add_event_routes(router_);
  add_scene_routes(router_);
  add_system_routes(router_);
}

std::string Service::url() const {
  const std::string& host = config_.http.address;
  return (config_.http.certificate_file.empty() ? "http://" : "https://") +
         (host.find(':') == std::string::npos ? host : '[' + host + ']') + ":" +
         std::to_string(port());
}

void Service::run() {
  return_freed_memory_to_system();
  // Builds stop while requests in progress finish.
  std::thread cleaner([this] {
    clean_up_periodically();
    dispatcher_.stop();
  });
  http_.run(config_.drain_timeout_s);
  stop();
  cleaner.join();
}

void Service::stop() {
  {
    std::lock_guard lock(stop_mutex_);
    draining_ = true;
  }
  stop_wake_.notify_all();
  queue_.announce();  // wakes event streams
  http_.stop();
}

void Service::clean_up_periodically() {
  std::unique_lock lock(stop_mutex_);
  while (!draining_) {
    try {
      scenes_.remove_stale_uploads(unix_seconds() - config_.retention.upload_days * kSecondsPerDay);
    } catch (const Error& error) {
      log_("cannot remove old uploads: " + error.message());
    }
    stop_wake_.wait_for(lock, kCleanUpInterval, [this] { return draining_.load(); });
  }
}

Response Service::answer(Request& request) {
  const double start_s = wall_seconds();
  Response response;
  try {
    response = router_.route(request, access_);
  } catch (const std::exception& error) {
    const Problem problem = public_problem(error);
    if (problem.detail != error.what())  // clients do not see this text
      log_("request " + request.id + " " + request.method + " failed: " + error.what());
    response = problem_response(problem);
  }
  record(request, response.status, start_s);
  return response;
}

void Service::record(const Request& request, int status, double start_s) {
  metrics_.count_request(status, wall_seconds() - start_s);
  if (request.method == "GET" || request.method == "HEAD") return;
  log_("audit " + request.method + " " + request.target.path.substr(0, kMaxLoggedChars) +
       " status=" + std::to_string(status) +
       " who=" + (request.caller.empty() ? "-" : request.caller) + " from=" + request.peer +
       " request=" + request.id);
}

}  // namespace voxdag::server
