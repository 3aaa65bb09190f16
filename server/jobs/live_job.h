// A running job: its progress, collected from the messages of the job's process, and whether a stop
// was requested. Thread-safe.
#pragma once

#include <cstdint>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/clock.h"
#include "server/jobs/overall_progress.h"
#include "server/jobs/protocol/job_messages.h"
#include "server/jobs/rate_history.h"

namespace voxdag::server {

class LiveJob {
 public:
  // `stages` are the long stages of the job's build.
  explicit LiveJob(uint64_t memory_bytes, std::vector<StageShare> stages = {})
      : memory_bytes_(memory_bytes), shares_(std::move(stages)) {}

  // Memory limit of the job's process.
  uint64_t memory_bytes() const { return memory_bytes_; }

  // Applies a message of the job's process. Makes its texts printable, and cuts long texts.
  void apply(const Message& message);
  // Returns the JSON object PROGRESS of docs/api.md; "" before the first stage. Keeps the text
  // until the next message arrives.
  std::string progress_json() const;
  // Returns the JSON object RATES of docs/api.md.
  std::string rates_json() const;
  // Returns the number of messages received so far.
  uint64_t version() const { return locked(version_); }
  // Returns the cluster tasks of this run; nullopt for a build without a cluster.
  std::optional<ClusterTasks> cluster_tasks() const { return locked(cluster_tasks_); }
  std::vector<Warning> warnings() const { return locked(warnings_); }
  std::optional<Failure> failure() const { return locked(failure_); }
  // Returns the result as JSON; "" before the job's process has reported one.
  std::string result() const { return locked(result_); }

  // Requests a stop. Further calls have no effect.
  void stop();
  // Returns the time (wall_seconds()) of the first call of stop(); 0 if stop() was not called.
  double stop_requested_s() const { return locked(stop_requested_s_); }

 private:
  std::string make_progress() const;
  // Returns the member "overall" of PROGRESS. Its fraction never decreases.
  nlohmann::ordered_json make_overall() const;
  template <class T>
  T locked(const T& value) const {
    std::lock_guard lock(mutex_);
    return value;
  }

  const uint64_t memory_bytes_;
  const std::vector<StageShare> shares_;
  const double start_s_ = wall_seconds();
  mutable std::mutex mutex_;  // guards all members below
  std::vector<StageProgress> stages_;
  std::vector<RateHistory> rates_;  // for each of stages_
  SubvolumeTotals subvolumes_;
  Usage usage_;
  std::optional<ClusterTasks> cluster_tasks_;
  std::vector<Warning> warnings_;
  std::optional<Failure> failure_;
  std::string result_;
  uint64_t version_ = 1;
  mutable uint64_t json_version_ = 0;
  mutable std::string json_;
  mutable double fraction_ = 0;  // the largest fraction reported so far
  double stop_requested_s_ = 0;
};

}  // namespace voxdag::server
