#include "server/config/config.h"

#include <concepts>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "server/http/connection/listener.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxConfigBytes = uint64_t{1} << 20;

[[noreturn]] void fail(const std::string& name, const std::string& expected) {
  throw Error(ErrorCode::kInvalidInput, "'" + name + "': expected " + expected);
}

void read_value(const nlohmann::json& value, const std::string& name, std::string& out) {
  if (!value.is_string()) fail(name, "a string");
  out = value.get<std::string>();
}

void read_value(const nlohmann::json& value, const std::string& name,
                std::vector<std::string>& out) {
  if (!value.is_array()) fail(name, "a list of strings");
  out.clear();
  for (const nlohmann::json& item : value) read_value(item, name, out.emplace_back());
}

void read_value(const nlohmann::json& value, const std::string& name, double& out) {
  if (!value.is_number() || value.get<double>() < 0) fail(name, "a number that is not negative");
  out = value.get<double>();
}

// Sizes may have a unit.
template <std::integral Integer>
void read_value(const nlohmann::json& value, const std::string& name, Integer& out) {
  if constexpr (std::is_same_v<Integer, uint64_t>) {
    if (value.is_string()) {
      out = parse_size(value.get<std::string>(), name);
      return;
    }
  }
  const bool fits = value.is_number_integer() &&
                    (!value.is_number_unsigned() ? std::in_range<Integer>(value.get<int64_t>())
                                                 : std::in_range<Integer>(value.get<uint64_t>()));
  if (!fits) fail(name, "a whole number in range");
  out = value.get<Integer>();
}

// The members of one object, each with the function that reads it.
class Members {
 public:
  template <class T>
  Members& add(const std::string& name, T& out) {
    readers_[name] = [name, &out](const nlohmann::json& value) { read_value(value, name, out); };
    return *this;
  }
  Members& nest(const std::string& name, const Members& members) {
    readers_[name] = [name, members](const nlohmann::json& value) { members.read(value, name); };
    return *this;
  }
  void read(const nlohmann::json& object, const std::string& where) const {
    if (!object.is_object()) fail(where, "an object");
    for (const auto& [name, value] : object.items()) {
      const auto reader = readers_.find(name);
      if (reader == readers_.end()) fail(name, "one of the members in docs/operating.md");
      reader->second(value);
    }
  }

 private:
  std::map<std::string, std::function<void(const nlohmann::json&)>> readers_;
};

Members members_of(ServerConfig& c) {
  Members tls, jobs, cluster, transfers, connections, retention, all;
  tls.add("certificate_file", c.http.certificate_file).add("key_file", c.http.key_file);
  jobs.add("max_concurrent", c.jobs.max_concurrent)
      .add("memory", c.jobs.memory_bytes)
      .add("threads", c.jobs.threads)
      .add("min_free_disk", c.jobs.min_free_disk_bytes)
      .add("nice", c.jobs.nice)
      .add("max_attempts", c.jobs.max_attempts)
      .add("backoff_s", c.jobs.backoff_s)
      .add("max_backoff_s", c.jobs.max_backoff_s)
      .add("stop_timeout_s", c.jobs.stop_timeout_s)
      .add("max_queued", c.jobs.max_queued)
      .add("plan_timeout_s", c.jobs.plan_timeout_s)
      .add("max_concurrent_plans", c.jobs.max_concurrent_plans);
  cluster.add("engine", c.cluster.engine)
      .add("tasks", c.cluster.tasks)
      .add("running", c.cluster.max_running)
      .add("options", c.cluster.submit_options)
      .add("program", c.cluster.program_path)
      .add("retries", c.cluster.max_retries)
      .add("grace_s", c.cluster.grace_s);
  transfers.add("max_scene_size", c.transfers.max_scene_bytes)
      .add("max_body_size", c.transfers.max_body_bytes)
      .add("max_concurrent", c.transfers.max_concurrent)
      .add("max_per_client", c.transfers.max_per_client)
      .add("max_event_streams", c.transfers.max_event_streams)
      .add("max_event_streams_per_client", c.transfers.max_event_streams_per_client)
      .add("max_requests_per_s", c.transfers.max_requests_per_s);
  connections.add("max_connections", c.http.limits.max_connections)
      .add("max_per_client", c.http.limits.max_per_client)
      .add("max_header_size", c.http.limits.max_header_bytes)
      .add("header_timeout_s", c.http.limits.header_timeout_s)
      .add("idle_timeout_s", c.http.limits.idle_timeout_s)
      .add("grace_s", c.http.limits.grace_s)
      .add("min_bytes_per_s", c.http.limits.min_bytes_per_s);
  retention.add("finished_days", c.retention.finished_days)
      .add("finished_jobs", c.retention.finished_jobs)
      .add("upload_days", c.retention.upload_days);
  all.add("address", c.http.address)
      .add("port", c.http.port)
      .add("data_folder", c.data_folder)
      .add("token_file", c.token_file)
      .add("scene_roots", c.scene_roots)
      .add("hosts", c.hosts)
      .add("drain_timeout_s", c.drain_timeout_s)
      .nest("tls", tls)
      .nest("jobs", jobs)
      .nest("cluster", cluster)
      .nest("transfers", transfers)
      .nest("connections", connections)
      .nest("retention", retention);
  return all;
}

}  // namespace

void read_config(FileSystem& files, const std::string& path, ServerConfig& config) {
  const std::string text = read_small_file(files, path, kMaxConfigBytes);
  try {
    members_of(config).read(nlohmann::json::parse(text), "the file");
  } catch (const nlohmann::json::exception& error) {
    throw Error(ErrorCode::kInvalidInput, path + ": expected JSON; " + std::string(error.what()));
  } catch (const Error& error) {
    throw Error(error.code(), path + ": " + error.message());
  }
}

void check_config(const ServerConfig& config) {
  const auto expect = [](bool holds, const std::string& what) {
    if (!holds) throw Error(ErrorCode::kInvalidInput, what);
  };
  expect(!config.data_folder.empty(), "no data folder: expected one (--data DIR, data_folder)");
  expect(config.http.port >= 0 && config.http.port <= 65535, "the port: expected 0 to 65535");
  expect(config.http.certificate_file.empty() == config.http.key_file.empty(),
         "TLS needs both files, the certificate and its key");
  expect(!config.token_file.empty() || is_loopback_name(config.http.address),
         "refusing to listen on " + config.http.address +
             " without tokens: anybody who can reach this port could build and delete. Make a "
             "token file (voxdag token --role admin --name you >> tokens) and name it (--tokens "
             "FILE), or listen on 127.0.0.1");
  expect(config.jobs.max_concurrent >= 1 && config.jobs.max_attempts >= 1,
         "jobs.max_concurrent and jobs.max_attempts: expected at least 1");
  expect(
      config.http.limits.max_connections >= 8 && config.http.limits.min_bytes_per_s > 0,
      "connections.max_connections: expected at least 8, connections.min_bytes_per_s: more than 0");
  expect(config.jobs.memory_bytes == 0 ||
             config.jobs.memory_bytes / config.jobs.max_concurrent >= kMinMemory,
         "jobs.memory: expected at least 64MiB for each of jobs.max_concurrent");
  expect(config.cluster.engine.empty() || config.cluster.engine == "slurm",
         "cluster.engine: expected slurm");
  for (const std::string& root : config.scene_roots)
    expect(root.starts_with('/'), "scene_roots: '" + root + "': expected an absolute folder");
}

}  // namespace voxdag::server
