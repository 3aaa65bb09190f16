#include "server/queue/ended_jobs.h"

namespace voxdag::server {

EndedJobs::EndedJobs(const std::string& path) : database_(path, SqlDatabase::Mode::kReadOnly) {}

int64_t EndedJobs::last_number() {
  std::lock_guard lock(mutex_);
  return database_.integer("SELECT coalesce(max(number), 0) FROM job_event");
}

std::vector<JobEnd> EndedJobs::after(int64_t number, size_t limit) {
  std::lock_guard lock(mutex_);
  auto rows = database_.prepare(
      "SELECT number, at_s, state, attempt, error, job FROM job_event WHERE number > ? AND state "
      ">= "
      "? ORDER BY number LIMIT ?");
  rows.bind(0, number)
      .bind(1, static_cast<int64_t>(JobState::kCanceled))
      .bind(2, static_cast<int64_t>(limit));
  std::vector<JobEnd> ends;
  while (rows.step())
    ends.push_back({rows.text(5),
                    {rows.integer(0), rows.real(1), static_cast<JobState>(rows.integer(2)),
                     static_cast<unsigned>(rows.integer(3)), rows.text(4)}});
  return ends;
}

}  // namespace voxdag::server
