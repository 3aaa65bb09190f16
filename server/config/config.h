// What the operator decides: the file of `voxdag serve --config`, docs/operating.md.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/io/file_system.h"
#include "scheduler/spec/build_spec.h"
#include "server/base/steps.h"
#include "server/http/http_server.h"

namespace voxdag::server {

struct JobLimits {
  unsigned max_concurrent = 1;
  uint64_t memory_bytes = 0;  // total of all running jobs; 0 for half of the machine's memory
  unsigned threads = 0;       // default of a job; 0 for all cores
  uint64_t min_free_disk_bytes = uint64_t{1} << 30;  // with less, no job starts
  int nice = 5;                                      // of the processes that build
  unsigned max_attempts = 5;
  double backoff_s = 15;  // before the second attempt; doubles for each further one
  double max_backoff_s = 900;
  double stop_timeout_s = 8;    // for a build to stop at a checkpoint before it is killed
  uint64_t max_queued = 20000;  // jobs that have not ended
  double plan_timeout_s = 120;  // for a dry run
  unsigned max_concurrent_plans = 1;
};

struct TransferLimits {
  uint64_t max_scene_bytes = uint64_t{64} << 30;
  uint64_t max_body_bytes = 64 << 10;  // of JSON
  size_t max_concurrent = 64;          // uploads, and as many downloads
  size_t max_per_client = 16;          // of each
  size_t max_event_streams = 256;
  size_t max_event_streams_per_client = 64;
  double max_requests_per_s = 200;  // per address, twice that in bursts; the loopback is exempt
};

struct Retention {
  double finished_days = 30;  // for jobs that have ended, and their files
  uint64_t finished_jobs = 10000;
  double upload_days = 2;  // for unfinished uploads
};

struct ServerConfig {
  HttpOptions http;
  std::string data_folder;
  std::string token_file;                // "" for none: loopback only
  std::vector<std::string> scene_roots;  // absolute folders whose scenes jobs may name by path
  std::vector<std::string> hosts;  // names allowed in a Host header in addition to the loopback's
  // Runs the jobs. This is this program, even after another was installed under the same name.
  std::string program = "/proc/self/exe";
  JobLimits jobs;
  ClusterOptions cluster;  // where subvolumes are built; no engine: on this machine
  TransferLimits transfers;
  Retention retention;
  bool adopt = false;          // takes up jobs and scenes whose records are lost
  StepHook before_step;        // for tests
  double drain_timeout_s = 5;  // for requests in progress when the service stops
};

// Applies a JSON file to `config`. Throws Error{kInvalidInput} naming the file and the member that
// is unknown or has a wrong value.
void read_config(FileSystem& files, const std::string& path, ServerConfig& config);
// Throws Error{kInvalidInput} if the parts do not go together: no data folder, an address that is
// not the loopback without tokens, a certificate without its key.
void check_config(const ServerConfig& config);

}  // namespace voxdag::server
