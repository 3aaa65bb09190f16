// A job while its process runs: its progress, put together from what the process reports, and
// whether it is to stop. Thread-safe.
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/jobs/process/task.h"

namespace voxdag::server {

class LiveJob {
 public:
  LiveJob(std::string id, uint64_t memory_bytes);

  const std::string& id() const { return id_; }
  uint64_t memory_bytes() const { return memory_bytes_; }

  // Returns true for what everybody who follows should be told at once (a stage, a warning).
  bool take(const Report& report);
  // PROGRESS of docs/api.md; the text is made once for each report.
  std::string progress_json() const;
  // Counts reports that changed the progress.
  uint64_t version() const;
  std::vector<std::string> warnings() const;
  std::optional<Report> failure() const;
  std::string result() const;  // "" if there is none

  // Asks for an end, once or more often; the first asking counts. When that was (wall_seconds()),
  // or 0.
  void stop();
  double stop_asked_s() const;

 private:
  struct Stage {
    std::string name, unit;
    uint64_t done = 0, total = 0;
    double start_s = 0, wall_s = 0;
    bool ended = false;
  };
  std::string make_progress() const;

  const std::string id_;
  const uint64_t memory_bytes_;
  const double start_s_;
  mutable std::mutex mutex_;  // guards all below
  std::vector<Stage> stages_;
  Report built_;
  std::vector<std::string> warnings_;
  std::optional<Report> failure_;
  std::string result_;
  uint64_t version_ = 1;
  mutable uint64_t json_version_ = 0;
  mutable std::string json_;
  double stop_asked_s_ = 0;
};

}  // namespace voxdag::server
