// Reads the ends of jobs (succeeded, failed, canceled) from the queue's database, in the order in
// which they occurred. Thread-safe.
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "core/db/sqlite.h"
#include "server/queue/job.h"

namespace voxdag::server {

struct JobEnd {
  std::string job;
  JobEvent event;
};

class EndedJobs {
 public:
  // Opens the database of a JobQueue, which must exist.
  explicit EndedJobs(const std::string& path);

  // Returns the number of the newest event of any kind; 0 if there are none.
  int64_t last_number();
  // Returns the first `limit` ends with numbers above `number`. Leaves out deleted jobs.
  std::vector<JobEnd> after(int64_t number, size_t limit);

 private:
  std::mutex mutex_;
  SqlDatabase database_;
};

}  // namespace voxdag::server
