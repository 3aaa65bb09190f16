// The operator's settings: the file of `voxdag serve --config`, docs/operating.md.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/io/file_system.h"
#include "scheduler/spec/build_spec.h"
#include "server/base/log.h"
#include "server/base/steps.h"
#include "server/http/http_server.h"

namespace voxdag::server {

struct JobLimits {
  unsigned max_concurrent = 1;
  uint64_t memory_bytes = 0;  // for all running jobs together; 0: half of the machine's memory
  unsigned threads = 0;       // default number per job; 0: all cores
  // Maximum size of the folder DATA/cache, through which jobs share built subvolumes. With 0, jobs
  // share none.
  uint64_t cache_bytes = 0;
  uint64_t min_free_disk_bytes = uint64_t{1} << 30;  // a job starts only if this much space is free
  int nice = 5;                                      // nice value of the jobs' processes
  unsigned max_attempts = 5;
  double backoff_s = 15;  // pause before the second attempt; doubles with each further attempt
  double max_backoff_s = 900;
  double stop_timeout_s = 8;    // time for a build to stop at a checkpoint before it is killed
  uint64_t max_queued = 20000;  // maximum number of unfinished jobs
  double plan_timeout_s = 120;  // per dry run
  unsigned max_concurrent_plans = 1;
};

struct ExportLimits {
  uint64_t memory_bytes = 0;  // per export; 0: a quarter of the machine's memory
  size_t max_per_job = 16;
};

struct TransferLimits {
  uint64_t max_scene_bytes = uint64_t{64} << 30;
  uint64_t max_body_bytes = 64 << 10;  // JSON bodies
  // Maximum numbers of concurrent transfers, in total and per client. The limits apply separately
  // to uploads, to downloads, and to requests for tiles.
  size_t max_concurrent = 64;
  size_t max_per_client = 16;
  size_t max_event_streams = 256;
  size_t max_event_streams_per_client = 64;
  // Rate limit per address. A burst may have twice this number of requests. The loopback is exempt.
  double max_requests_per_s = 200;
};

struct Retention {
  double finished_days = 30;       // retention of ended jobs and their files
  uint64_t finished_jobs = 10000;  // maximum number of ended jobs that are kept per token
  double upload_days = 2;          // retention of unfinished uploads
};

struct WebhookOptions {
  std::vector<std::string> allow;  // prefixes of the URLs that jobs may name
  std::string secret_file;         // file with the key of signatures; "": no signatures
  std::string ca_file;             // certificates that https receivers may have; "": the system's
  unsigned max_attempts = 10;
  double backoff_s = 10;  // pause before the second attempt; doubles with each further attempt
  double max_backoff_s = 3600;
  double timeout_s = 10;  // per attempt
};

struct ServerConfig {
  HttpOptions http;
  std::string data_folder;
  std::string token_file;                // "": no tokens; only the loopback has access
  std::vector<std::string> scene_roots;  // absolute folders whose scenes jobs may name by path
  std::vector<std::string> hosts;  // names allowed in a Host header in addition to the loopback's
  // Origins (SCHEME://HOST[:PORT]) whose web pages may show the viewer in a frame.
  std::vector<std::string> embed_origins;
  // Origins whose web pages may send requests to the API.
  std::vector<std::string> cors_origins;
  // The program that runs jobs. The default is the running program itself, even if another version
  // was installed under the same name since.
  std::string program = "/proc/self/exe";
  JobLimits jobs;
  ExportLimits exports;
  // The cluster that builds the subvolumes of jobs. If its engine is kNone, jobs use this machine.
  ClusterOptions cluster;
  TransferLimits transfers;
  Retention retention;
  WebhookOptions webhooks;
  LogFormat log_format = LogFormat::kText;
  bool access_log = false;     // the log also has the requests that only read
  bool adopt = false;          // jobs and scenes without records get new records
  StepHook before_step;        // used by tests
  double drain_timeout_s = 5;  // time for requests in progress when the service stops
};

// Applies a JSON file to `config`. Throws Error{kInvalidInput} with the file and the member that is
// unknown or has a wrong value.
void read_config(FileSystem& files, const std::string& path, ServerConfig& config);
// Throws Error{kInvalidInput} for a value outside its range, and for an invalid combination: no
// data folder, a certificate without its key, or no tokens for an address that is not the loopback.
void check_config(const ServerConfig& config);

}  // namespace voxdag::server
