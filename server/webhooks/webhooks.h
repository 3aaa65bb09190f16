// Sends webhooks: if the request of a job names a URL, posts a small JSON object to this URL when
// the job has ended (docs/api.md, "Webhooks"). Each end of a job is delivered at least once, also
// after a restart, unless all attempts fail. A slow receiver delays neither jobs nor deliveries to
// other receivers. Thread-safe.
//
// One thread reads the ends of jobs from the queue, stores their deliveries, and starts attempts.
// Each attempt has its own short-lived thread. The numbers of attempts in total and per receiver
// are limited, and each attempt has a deadline.
#pragma once

#include <atomic>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "server/base/http_url.h"
#include "server/base/steps.h"
#include "server/config/config.h"
#include "server/queue/ended_jobs.h"
#include "server/queue/job_queue.h"
#include "server/webhooks/webhook_store.h"

namespace voxdag::server {

class Webhooks {
 public:
  // Throws Error{kInvalidInput} for an invalid secret, and if this build cannot send to an https
  // URL that the configuration allows. Makes the process ignore SIGPIPE.
  Webhooks(const ServerConfig& config, FileSystem& files, JobQueue& queue, Log log);
  // Calls stop().
  ~Webhooks();

  // Throws RequestError{kInvalid} unless a job may name this URL.
  void check(const std::string& url) const;
  // Returns the member "webhook" of JOB (docs/api.md) as JSON; "null" if the job has none.
  std::string job_member(const Job& job);
  // For /metrics. All members except `pending` count since the start of the service.
  struct Statistics {
    uint64_t pending = 0, attempts = 0, delivered = 0, failed = 0;
  };
  Statistics statistics();
  // Starts no more attempts, and ends attempts in progress. The next service repeats the ended
  // attempts. Waits for the resolution of host names in progress, which cannot be ended.
  void stop();

 private:
  struct Attempt;

  bool is_allowed(const HttpUrl& url) const;
  void run();
  // Stores the deliveries of jobs that have ended since the last call.
  void collect();
  void collect(const JobEnd& end);
  void start_due_attempts();
  // Returns false if no delivery is due or all slots are in use.
  bool start_next_attempt();
  void start(const Delivery& delivery);
  // Runs on the attempt's thread.
  void send(Attempt& attempt) const;
  void end_overdue_attempts();
  void record_ended_attempts();
  void record(Attempt& attempt);
  // Counts a delivery that has ended.
  void count_end(const Delivery& delivery);
  void fail(Delivery delivery, const std::string& reason);
  void forget_deleted_jobs();
  double max_wait_s() const;

  const WebhookOptions& options_;
  JobQueue& queue_;
  const Log log_;
  Steps steps_;
  std::vector<HttpUrl> allowed_;
  std::string secret_;  // "": no signature
  EndedJobs ended_jobs_;
  WebhookStore store_;
  std::atomic<bool> stops_{false};
  std::atomic<uint64_t> ended_attempts_{0}, delivered_{0}, failed_{0};

  // Used only by thread_.
  std::list<std::unique_ptr<Attempt>> attempts_;
  int64_t last_event_ = 0;
  uint64_t seen_changes_ = 0;
  bool looks_ = true;         // if true, a delivery is possibly due
  double next_due_s_ = 0;     // Unix time at which the next delivery is due
  double last_look_s_ = 0;    // in wall_seconds()
  double next_forget_s_ = 0;  // in wall_seconds()

  std::thread thread_;
};

}  // namespace voxdag::server
