// A running job: its progress, collected from the messages of the job's process, and whether a stop
// was requested. Thread-safe.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/clock.h"
#include "server/jobs/protocol/job_messages.h"

namespace voxdag::server {

class LiveJob {
 public:
  explicit LiveJob(uint64_t memory_bytes) : memory_bytes_(memory_bytes) {}

  // Memory limit of the job's process.
  uint64_t memory_bytes() const { return memory_bytes_; }

  // Applies a message of the job's process. Its texts become printable and are cut if long.
  void apply(const Message& message);
  // Returns the JSON object PROGRESS of docs/api.md; "" before the first stage. Keeps the text
  // until the next message arrives.
  std::string progress_json() const;
  // Returns the number of messages received so far.
  uint64_t version() const { return locked(version_); }
  // Returns the cluster tasks of this run; nullopt for a build without a cluster.
  std::optional<ClusterTasks> cluster_tasks() const { return locked(cluster_tasks_); }
  std::vector<Warning> warnings() const { return locked(warnings_); }
  std::optional<Failure> failure() const { return locked(failure_); }
  // Returns the result as JSON; "" before the job's process has reported one.
  std::string result() const { return locked(result_); }

  // Requests a stop. Only the first call counts.
  void stop();
  // Returns the time (wall_seconds()) of the first call of stop(); 0 if stop() was not called.
  double stop_requested_s() const { return locked(stop_requested_s_); }

 private:
  struct Stage {
    std::string name, unit;
    uint64_t done = 0, total = 0, resumed_at = 0;
    double start_s = 0, wall_s = 0;
    bool ended = false;
  };
  std::string make_progress() const;
  template <class T>
  T locked(const T& value) const {
    std::lock_guard lock(mutex_);
    return value;
  }

  const uint64_t memory_bytes_;
  const double start_s_ = wall_seconds();
  mutable std::mutex mutex_;  // guards all members below
  std::vector<Stage> stages_;
  SubvolumeTotals subvolumes_;
  Usage usage_;
  std::optional<ClusterTasks> cluster_tasks_;
  std::vector<Warning> warnings_;
  std::optional<Failure> failure_;
  std::string result_;
  uint64_t version_ = 1;
  mutable uint64_t json_version_ = 0;
  mutable std::string json_;
  double stop_requested_s_ = 0;
};

}  // namespace voxdag::server
