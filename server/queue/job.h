// A job as stored in the queue.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/warning.h"

namespace voxdag::server {

// The changes of state and their reasons:
//
//   queued ──▶ running
//          ──▶ suspended  request of a client
//          ──▶ canceled   request of a client
//          ──▶ failed     the stored request cannot be read
//   running ─▶ succeeded
//          ──▶ failed     error of the build
//          ──▶ queued     transient error, or the service stopped
//          ──▶ suspended  request of a client
//          ──▶ canceling  request of a client
//   suspended ▶ queued    request of a client (resume)
//          ──▶ canceled   request of a client
//          ──▶ canceling  request of a client, while the process of the job still runs
//   canceling ▶ canceled  the process of the job has ended
//   failed ──▶ queued     request of a client (retry)
//   canceled ▶ queued     request of a client (retry)
enum class JobState {
  kQueued,
  kRunning,
  kSuspended,
  kCanceling,
  kCanceled,
  kFailed,
  kSucceeded,
};

inline constexpr std::array<const char*, 7> kJobStateNames = {
    "queued", "running", "suspended", "canceling", "canceled", "failed", "succeeded"};

inline const char* state_name(JobState state) { return kJobStateNames[static_cast<size_t>(state)]; }
std::optional<JobState> parse_state(std::string_view name);
// True for canceled, failed and succeeded. Only a retry changes the states canceled and failed. The
// state succeeded is final.
inline bool has_ended(JobState state) { return state >= JobState::kCanceled; }

struct JobError {
  std::string code;  // a code of docs/errors.md, or "internal"
  std::string message;
  double at_s = 0;  // Unix time in seconds, like all times of a job; 0: never
  bool transient = false;
};

enum class Preview { kNone = 0, kReady = 1, kFailed = 2 };

struct Job {
  std::string id;
  int64_t number = 0;  // jobs are numbered in the order of their submission
  std::string name;
  JobState state = JobState::kQueued;
  std::string request;              // JSON: scene, resolution, options
  std::vector<std::string> scenes;  // uploads that the job needs until it ends
  std::string posted_by;            // name of the token of the client that submitted the job
  int priority = 0;
  bool front = false;  // was running before; so it comes first among the jobs of its priority
  unsigned attempts = 0;
  unsigned interruptions = 0;  // number of consecutive runs that ended because the service ended
  double created_s = 0, started_s = 0, finished_s = 0, not_before_s = 0;
  std::optional<JobError> error;
  std::vector<Warning> warnings;
  std::string result;    // JSON; "" until the job succeeded
  std::string progress;  // JSON of the last attempt, "" before the first
  Preview preview = Preview::kNone;
};

// One change of a job's state. The events of all jobs are numbered together, in the order in which
// they occurred.
struct JobEvent {
  int64_t number = 0;
  double at_s = 0;
  JobState state = JobState::kQueued;
  unsigned attempt = 0;
  std::string error;  // error code; "" for none
};

}  // namespace voxdag::server
