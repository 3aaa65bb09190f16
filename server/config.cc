#include "server/config.h"

#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "server/http/connection/listener.h"

namespace voxdag::server {
namespace {

using nlohmann::json;

constexpr uint64_t kLargestConfig = uint64_t{1} << 20;

[[noreturn]] void fail(const std::string& name, const std::string& expected) {
  throw Error(ErrorCode::kInvalidInput, "'" + name + "': expected " + expected);
}

void take(const json& value, const std::string& name, std::string& out) {
  if (!value.is_string()) fail(name, "a text");
  out = value.get<std::string>();
}

void take(const json& value, const std::string& name, std::vector<std::string>& out) {
  if (!value.is_array()) fail(name, "a list of texts");
  out.clear();
  for (const json& item : value) take(item, name, out.emplace_back());
}

void take(const json& value, const std::string& name, double& out) {
  if (!value.is_number() || value.get<double>() < 0) fail(name, "a number that is not negative");
  out = value.get<double>();
}

template <class Integer>
void take_integer(const json& value, const std::string& name, Integer& out) {
  const bool fits = value.is_number_integer() &&
                    (!value.is_number_unsigned() ? std::in_range<Integer>(value.get<int64_t>())
                                                 : std::in_range<Integer>(value.get<uint64_t>()));
  if (!fits) fail(name, "a whole number in range");
  out = value.get<Integer>();
}
void take(const json& value, const std::string& name, int& out) { take_integer(value, name, out); }
void take(const json& value, const std::string& name, unsigned& out) {
  take_integer(value, name, out);
}
// Sizes may have a unit.
void take(const json& value, const std::string& name, uint64_t& out) {
  if (value.is_string()) {
    out = parse_size(value.get<std::string>(), name);
  } else {
    take_integer(value, name, out);
  }
}

// The members of one object, each with what takes it.
class Members {
 public:
  template <class T>
  Members& add(const std::string& name, T& out) {
    takers_[name] = [name, &out](const json& value) { take(value, name, out); };
    return *this;
  }
  Members& nest(const std::string& name, const Members& members) {
    takers_[name] = [name, members](const json& value) { members.read(value, name); };
    return *this;
  }
  void read(const json& object, const std::string& where) const {
    if (!object.is_object()) fail(where, "an object");
    for (const auto& [name, value] : object.items()) {
      const auto taker = takers_.find(name);
      if (taker == takers_.end()) fail(name, "one of the members in docs/operating.md");
      taker->second(value);
    }
  }

 private:
  std::map<std::string, std::function<void(const json&)>> takers_;
};

Members members_of(ServerConfig& c) {
  Members tls, jobs, transfers, connections, retention, all;
  tls.add("certificate", c.http.certificate_file).add("key", c.http.key_file);
  jobs.add("max_concurrent", c.jobs.max_concurrent)
      .add("memory", c.jobs.memory_bytes)
      .add("threads", c.jobs.threads)
      .add("min_free_disk", c.jobs.min_free_disk_bytes)
      .add("nice", c.jobs.nice)
      .add("attempts", c.jobs.attempts)
      .add("backoff_s", c.jobs.backoff_s)
      .add("max_backoff_s", c.jobs.max_backoff_s)
      .add("grace_s", c.jobs.grace_s)
      .add("queued", c.jobs.queued)
      .add("plan_s", c.jobs.plan_s)
      .add("max_concurrent_plans", c.jobs.max_concurrent_plans);
  transfers.add("scene", c.transfers.scene_bytes)
      .add("body", c.transfers.body_bytes)
      .add("transfers", c.transfers.transfers)
      .add("event_streams", c.transfers.event_streams)
      .add("requests_per_s", c.transfers.requests_per_s);
  connections.add("connections", c.http.limits.max_connections)
      .add("per_address", c.http.limits.max_per_address)
      .add("header", c.http.limits.max_header_bytes)
      .add("header_s", c.http.limits.header_timeout_s)
      .add("idle_s", c.http.limits.idle_timeout_s)
      .add("grace_s", c.http.limits.grace_s)
      .add("min_bytes_per_s", c.http.limits.min_bytes_per_s);
  retention.add("finished_days", c.retention.finished_days)
      .add("finished_jobs", c.retention.finished_jobs)
      .add("upload_days", c.retention.upload_days);
  all.add("listen", c.http.address)
      .add("port", c.http.port)
      .add("data", c.data_folder)
      .add("tokens", c.token_file)
      .add("scene_roots", c.scene_roots)
      .add("hosts", c.hosts)
      .add("drain_s", c.drain_s)
      .nest("tls", tls)
      .nest("jobs", jobs)
      .nest("transfers", transfers)
      .nest("connections", connections)
      .nest("retention", retention);
  return all;
}

}  // namespace

void read_config(FileSystem& files, const std::string& path, ServerConfig& config) {
  const std::string text = read_small_file(files, path, kLargestConfig);
  try {
    members_of(config).read(json::parse(text), "the whole");
  } catch (const json::exception& error) {
    throw Error(ErrorCode::kInvalidInput, path + ": expected JSON; " + std::string(error.what()));
  } catch (const Error& error) {
    throw Error(error.code(), path + ": " + error.message());
  }
}

void check_config(const ServerConfig& config) {
  const auto expect = [](bool holds, const std::string& what) {
    if (!holds) throw Error(ErrorCode::kInvalidInput, what);
  };
  expect(!config.data_folder.empty(), "no data folder: give one (--data DIR)");
  expect(config.http.port >= 0 && config.http.port <= 65535, "the port: expected 0 to 65535");
  expect(config.http.certificate_file.empty() == config.http.key_file.empty(),
         "TLS needs both files, the certificate and its key");
  expect(!config.token_file.empty() || is_loopback_name(config.http.address),
         "refusing to listen on " + config.http.address +
             " without tokens: anybody who can reach this port could build and delete. Make a "
             "token file (voxdag token --role admin --name you >> tokens) and name it (--tokens "
             "FILE), or listen on 127.0.0.1");
  expect(config.jobs.max_concurrent >= 1 && config.jobs.attempts >= 1,
         "jobs.max_concurrent and jobs.attempts: expected at least 1");
  expect(config.http.limits.max_connections >= 8 && config.http.limits.min_bytes_per_s > 0,
         "connections.connections: expected at least 8, connections.min_bytes_per_s: more than 0");
  expect(config.jobs.memory_bytes == 0 ||
             config.jobs.memory_bytes / config.jobs.max_concurrent >= kMinMemory,
         "jobs.memory: expected at least 64MiB for each job at a time");
  for (const std::string& root : config.scene_roots)
    expect(root.starts_with('/'), "scene_roots: '" + root + "': expected an absolute folder");
}

}  // namespace voxdag::server
