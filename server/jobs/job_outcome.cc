#include "server/jobs/job_outcome.h"

#include <algorithm>
#include <cmath>
#include <csignal>

namespace voxdag::server {
namespace {

bool is_transient(const std::string& code) { return code == "no_space" || code == "io"; }

JobError error_of(const LiveJob& live, const ChildProcess::End& end, double now_s) {
  if (const auto failure = live.failure())
    return {failure->code, failure->text, now_s, is_transient(failure->code)};
  if (end.signal == SIGKILL)
    return {
        "out_of_memory",
        "the job's process was killed, perhaps by the system because memory ran out: expected more "
        "free memory, or a smaller 'memory' of the job",
        now_s, false};
  if (end.signal != 0)
    return {"internal",
            "the job's process crashed (signal " + std::to_string(end.signal) +
                "): retry the job, and report the defect if it fails again",
            now_s, false};
  return {"internal",
          "the job's process ended with status " + std::to_string(end.exit_status) +
              " and reported neither a result nor a failure: retry the job, and report the defect "
              "if it fails again",
          now_s, false};
}

void finish(Job& job, JobState state, double now_s) {
  job.state = state;
  job.finished_s = now_s;
}

}  // namespace

double pause_s(const JobLimits& limits, unsigned attempts) {
  const double exponent = std::min(attempts, 32u) - 1.0;
  return std::min(limits.max_backoff_s, limits.backoff_s * std::exp2(std::max(0.0, exponent)));
}

void apply_outcome(Job& job, const LiveJob& live, const ChildProcess::End& end,
                   const JobLimits& limits, double now_s) {
  job.interruptions = 0;
  job.warnings = live.warnings();
  job.progress = live.progress_json();
  const bool asked = live.stop_requested_s() > 0;
  if (const std::string result = live.result(); !result.empty()) {
    if (job.state == JobState::kCanceling) return finish(job, JobState::kCanceled, now_s);
    job.result = result;
    job.error.reset();
    return finish(job, JobState::kSucceeded, now_s);
  }
  const JobError error = error_of(live, end, now_s);
  // The stop signal can end a process before the process handles signals. Such a process sends no
  // failure message, but also counts as stopped.
  const bool stopped = asked && (error.code == "canceled" || !live.failure());
  if (!stopped) job.error = error;
  if (job.state == JobState::kCanceling) return finish(job, JobState::kCanceled, now_s);
  // A state other than running means that a client has suspended the job, and has perhaps resumed
  // it since. Such a state is kept.
  if (job.state != JobState::kRunning) return;
  if (stopped || error.code == "canceled") {
    job.state = JobState::kQueued;
    job.front = true;
  } else if (error.transient && job.attempts < limits.max_attempts) {
    job.state = JobState::kQueued;
    job.not_before_s = now_s + pause_s(limits, job.attempts);
  } else {
    finish(job, JobState::kFailed, now_s);
  }
}

}  // namespace voxdag::server
