#include "server/config/config.h"

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "scheduler/cluster/cluster.h"
#include "scheduler/spec/build_fields.h"
#include "server/base/http_url.h"
#include "server/http/connection/listener.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMaxConfigBytes = uint64_t{1} << 20;
// Minimum limit of a request's header and of JSON bodies. Smaller limits would refuse most
// requests.
constexpr uint64_t kMinMessageBytes = 1024;
constexpr int kMinNice = -20, kMaxNice = 19;
constexpr size_t kMaxWebhookPrefixes = 64;
constexpr double kMaxWebhookTimeoutS = 300;
constexpr const char* kExpectedOrigin =
    "expected an origin, such as https://lab.example.org or http://localhost:8888";

// True if the text has the form http://HOST[:PORT] or https://HOST[:PORT]. Allows only characters
// of host names, IP addresses and ports, because origins are written to header fields of responses.
bool is_origin(const std::string& text) {
  const size_t host = text.starts_with("https://") ? 8 : text.starts_with("http://") ? 7 : 0;
  constexpr const char* kAllowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-:[]";
  return host > 0 && host < text.size() &&
         text.find_first_not_of(kAllowed, host) == std::string::npos;
}

// True if the text can be the host, without a port, of a Host header field.
bool is_host(const std::string& text) {
  constexpr const char* kAllowed =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_";
  if (text.starts_with('[')) return text.ends_with(']') && text.size() > 2;
  return !text.empty() && text.find_first_not_of(kAllowed) == std::string::npos;
}

// Refuses numbers outside their ranges. Checks them here and not in fields(), because the messages
// of fields() do not name the object of a member.
void check_ranges(const ServerConfig& config) {
  const auto check = [](const char* name, auto value, bool fits, const std::string& expected) {
    if (fits) return;
    throw Error(ErrorCode::kInvalidInput, std::string(name) + " is " +
                                              number_text(static_cast<double>(value)) +
                                              ": expected " + expected);
  };
  const auto at_least = [&](const char* name, auto value, uint64_t least) {
    check(name, value, value >= least, "at least " + std::to_string(least));
  };
  const auto above_zero = [&](const char* name, double value) {
    check(name, value, value > 0, "more than 0");
  };
  const JobLimits& jobs = config.jobs;
  at_least("jobs.max_concurrent", jobs.max_concurrent, 1);
  at_least("jobs.max_attempts", jobs.max_attempts, 1);
  at_least("jobs.max_queued", jobs.max_queued, 1);
  above_zero("jobs.plan_timeout_s", jobs.plan_timeout_s);
  check("jobs.threads", jobs.threads, jobs.threads <= kMaxOptionThreads,
        "0 (all cores) to " + std::to_string(kMaxOptionThreads));
  check("jobs.nice", jobs.nice, jobs.nice >= kMinNice && jobs.nice <= kMaxNice,
        std::to_string(kMinNice) + " to " + std::to_string(kMaxNice));
  const TransferLimits& transfers = config.transfers;
  at_least("transfers.max_scene_size", transfers.max_scene_bytes, 1);
  at_least("transfers.max_body_size", transfers.max_body_bytes, kMinMessageBytes);
  at_least("transfers.max_concurrent", transfers.max_concurrent, 1);
  at_least("transfers.max_per_client", transfers.max_per_client, 1);
  const auto& connections = config.http.limits;
  at_least("connections.max_connections", connections.max_connections, 8);
  at_least("connections.max_per_client", connections.max_per_client, 1);
  at_least("connections.max_header_size", connections.max_header_bytes, kMinMessageBytes);
  above_zero("connections.header_timeout_s", connections.header_timeout_s);
  above_zero("connections.idle_timeout_s", connections.idle_timeout_s);
  above_zero("connections.grace_s", connections.grace_s);
  above_zero("connections.min_bytes_per_s", connections.min_bytes_per_s);
}

void check_webhooks(const WebhookOptions& webhooks) {
  const auto expect = [](bool holds, const std::string& what) {
    if (!holds) throw Error(ErrorCode::kInvalidInput, what);
  };
  expect(webhooks.allow.size() <= kMaxWebhookPrefixes,
         "webhooks.allow has " + std::to_string(webhooks.allow.size()) +
             " items: expected at most " + std::to_string(kMaxWebhookPrefixes));
  for (const std::string& prefix : webhooks.allow) {
    const std::string place = "webhooks.allow: '" + prefix + "': ";
    expect(prefix.find('?') == std::string::npos, place + "expected a URL without a query");
    try {
      parse_http_url(prefix);
    } catch (const Error& error) {
      throw Error(error.code(), place + error.message());
    }
  }
  expect(webhooks.timeout_s <= kMaxWebhookTimeoutS,
         "webhooks.timeout_s is " + number_text(webhooks.timeout_s) + ": expected at most " +
             number_text(kMaxWebhookTimeoutS));
}

}  // namespace

template <class Visitor>
void fields(Visitor& visit, JobLimits& jobs) {
  visit("max_concurrent", jobs.max_concurrent);
  visit(Field("memory").bytes(), jobs.memory_bytes);
  visit("threads", jobs.threads);
  visit(Field("cache").bytes(), jobs.cache_bytes);
  visit(Field("min_free_disk").bytes(), jobs.min_free_disk_bytes);
  visit("nice", jobs.nice);
  visit("max_attempts", jobs.max_attempts);
  visit(Field("backoff_s").at_least(0), jobs.backoff_s);
  visit(Field("max_backoff_s").at_least(0), jobs.max_backoff_s);
  visit(Field("stop_timeout_s").at_least(0), jobs.stop_timeout_s);
  visit("max_queued", jobs.max_queued);
  visit(Field("plan_timeout_s").at_least(0), jobs.plan_timeout_s);
  visit("max_concurrent_plans", jobs.max_concurrent_plans);
}

template <class Visitor>
void fields(Visitor& visit, ExportLimits& exports) {
  visit(Field("memory").bytes(), exports.memory_bytes);
  visit("max_per_job", exports.max_per_job);
}

template <class Visitor>
void fields(Visitor& visit, TransferLimits& transfers) {
  visit(Field("max_scene_size").bytes(), transfers.max_scene_bytes);
  visit(Field("max_body_size").bytes(), transfers.max_body_bytes);
  visit("max_concurrent", transfers.max_concurrent);
  visit("max_per_client", transfers.max_per_client);
  visit("max_event_streams", transfers.max_event_streams);
  visit("max_event_streams_per_client", transfers.max_event_streams_per_client);
  visit(Field("max_requests_per_s").at_least(0), transfers.max_requests_per_s);
}

template <class Visitor>
void fields(Visitor& visit, Retention& retention) {
  visit(Field("finished_days").at_least(0), retention.finished_days);
  visit("finished_jobs", retention.finished_jobs);
  visit(Field("upload_days").at_least(0), retention.upload_days);
}

template <class Visitor>
void fields(Visitor& visit, WebhookOptions& webhooks) {
  visit("allow", webhooks.allow);
  visit("secret_file", webhooks.secret_file);
  visit("ca_file", webhooks.ca_file);
  visit(Field("max_attempts").range(1, 100), webhooks.max_attempts);
  visit(Field("backoff_s").range(0, 604800), webhooks.backoff_s);
  visit(Field("max_backoff_s").range(0, 604800), webhooks.max_backoff_s);
  visit(Field("timeout_s").above_zero(), webhooks.timeout_s);
}

template <class Visitor>
void fields(Visitor& visit, ServerConfig& c) {
  visit("address", c.http.address);
  visit("port", c.http.port);
  visit("data_folder", c.data_folder);
  visit("token_file", c.token_file);
  visit("scene_roots", c.scene_roots);
  visit("hosts", c.hosts);
  visit("embed_origins", c.embed_origins);
  visit("cors_origins", c.cors_origins);
  visit(Field("drain_timeout_s").at_least(0), c.drain_timeout_s);
  visit.object("tls", [&](auto& tls) {
    tls("certificate_file", c.http.certificate_file);
    tls("key_file", c.http.key_file);
  });
  visit("jobs", c.jobs);
  visit("exports", c.exports);
  // The cluster options of a service differ from the options of `build`: their names have no
  // prefix, and there is an option for the path of the program.
  visit.object("cluster", [&](auto& cluster) {
    cluster("engine", c.cluster.engine);
    cluster("tasks", c.cluster.tasks);
    cluster("running", c.cluster.max_running);
    cluster("options", c.cluster.submit_options);
    cluster("program", c.cluster.program_path);
    cluster("retries", c.cluster.max_retries);
    cluster(Field("grace_s").at_least(0), c.cluster.grace_s);
  });
  visit("transfers", c.transfers);
  visit.object("connections", [&](auto& connections) {
    connections("max_connections", c.http.limits.max_connections);
    connections("max_per_client", c.http.limits.max_per_client);
    connections(Field("max_header_size").bytes(), c.http.limits.max_header_bytes);
    connections(Field("header_timeout_s").at_least(0), c.http.limits.header_timeout_s);
    connections(Field("idle_timeout_s").at_least(0), c.http.limits.idle_timeout_s);
    connections(Field("grace_s").at_least(0), c.http.limits.grace_s);
    connections(Field("min_bytes_per_s").at_least(0), c.http.limits.min_bytes_per_s);
  });
  visit("retention", c.retention);
  visit("webhooks", c.webhooks);
  visit("log_format", c.log_format);
  visit("access_log", c.access_log);
}

void read_config(FileSystem& files, const std::string& path, ServerConfig& config) {
  const std::string text = read_small_file(files, path, kMaxConfigBytes);
  try {
    const auto json = parse_json<FieldJson>(text);
    if (const auto name = repeated_member(text)) json_fields::refuse_repeated(*name);
    set_options(json, "the file", config);
  } catch (const nlohmann::json::exception& error) {
    throw Error(ErrorCode::kInvalidInput, path + " is not JSON (" + error.what() +
                                              "): expected a JSON object with the settings");
  } catch (const Error& error) {
    throw Error(error.code(), path + ": " + error.message());
  }
}

void check_config(const ServerConfig& config) {
  if (config.cluster.engine != ClusterEngine::kNone) check_cluster_support();
  const auto expect = [](bool holds, const std::string& what) {
    if (!holds) throw Error(ErrorCode::kInvalidInput, what);
  };
  expect(!config.data_folder.empty(),
         "no data folder was given: expected one (--data DIR, data_folder)");
  expect(config.http.port >= 0 && config.http.port <= 65535,
         "port " + std::to_string(config.http.port) + ": expected 0 to 65535");
  expect(config.http.certificate_file.empty() == config.http.key_file.empty(),
         "certificate '" + config.http.certificate_file + "' and key '" + config.http.key_file +
             "': expected both files for TLS, or neither");
  expect(!config.token_file.empty() || is_loopback_name(config.http.address),
         "refusing to listen on " + config.http.address +
             " without tokens: anybody who can reach this port could build and delete. Make a "
             "token file (voxdag token --role admin --name you >> tokens) and name it (--tokens "
             "FILE), or listen on 127.0.0.1");
  check_ranges(config);
  const uint64_t usable = usable_memory();
  expect(config.jobs.memory_bytes <= usable,
         "jobs.memory is " + size_text(config.jobs.memory_bytes) + ": expected at most " +
             size_text(usable) + ", the memory that the service can use");
  expect(config.exports.memory_bytes <= usable,
         "exports.memory is " + size_text(config.exports.memory_bytes) + ": expected at most " +
             size_text(usable) + ", the memory that the service can use");
  expect(config.jobs.memory_bytes == 0 ||
             config.jobs.memory_bytes / config.jobs.max_concurrent >= kMinMemory,
         "jobs.memory is " + size_text(config.jobs.memory_bytes) +
             ": expected at least 64MiB for each of the " +
             std::to_string(config.jobs.max_concurrent) + " jobs of jobs.max_concurrent");
  expect(
      config.exports.memory_bytes == 0 || config.exports.memory_bytes >= kMinMemory,
      "exports.memory is " + size_text(config.exports.memory_bytes) + ": expected at least 64MiB");
  expect(config.jobs.cache_bytes == 0 || config.cluster.engine == ClusterEngine::kNone,
         "jobs.cache is " + size_text(config.jobs.cache_bytes) +
             ": expected no cache with cluster.engine, because builds of a cluster do not use it");
  check_webhooks(config.webhooks);
  for (const std::string& root : config.scene_roots)
    expect(root.starts_with('/'),
           "scene_roots: '" + root +
               "' is not an absolute path: expected the path of a folder that begins with /");
  for (const std::string& host : config.hosts)
    expect(is_host(host), "hosts: '" + host +
                              "': expected a host name without a port, such as "
                              "voxels.example.org or [2001:db8::1]");
  for (const std::string& origin : config.embed_origins)
    expect(is_origin(origin), "embed_origins: '" + origin + "': " + kExpectedOrigin);
  for (const std::string& origin : config.cors_origins)
    expect(is_origin(origin), "cors_origins: '" + origin + "': " + kExpectedOrigin);
}

}  // namespace voxdag::server
