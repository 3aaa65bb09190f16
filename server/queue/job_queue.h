// The service's jobs, durable: one SQLite file (WAL, synchronous = FULL). What a call returns has
// been committed. A SIGKILL between any two instructions leaves every job in a state that recover()
// repairs.
//
// Order of the queue: priority, then jobs that were running before, then the order of submission.
// Thread-safe; readers never wait for a writer's sync.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/db/sqlite.h"
#include "server/base/request_error.h"
#include "server/disk/data_folder.h"
#include "server/queue/job.h"

namespace voxdag::server {

struct JobFilter {
  std::vector<JobState> states;  // none for all
  int64_t before = INT64_MAX;    // job numbers below it
  size_t limit = 50;
};

struct IdempotencyKey {
  std::string key;      // "" for none
  std::string request;  // digest of the request
};

class JobQueue {
 public:
  // Throws Error{kCorrupt}, {kInvalidInput} for a database of another program, or for a missing
  // one unless `may_create`, {kUnsupportedVersion}.
  explicit JobQueue(const std::string& path, bool may_create = true);
  // Throws Error{kIo} if the database was removed or replaced.
  void check_file() const { file_.check(); }

  struct Added {
    Job job;
    bool replayed = false;
  };
  // Queues the job under its id, or a new one, or finds the job that has this key. Throws
  // RequestError: kKeyReused if the key came with another request, kBusy if `max_open` jobs
  // have not ended.
  Added add(Job job, const IdempotencyKey& key, uint64_t max_open);

  std::optional<Job> find(const std::string& id);
  // Newest first.
  std::vector<Job> list(const JobFilter& filter);
  std::map<JobState, uint64_t> counts();
  // Positions in the queue from 1, by job number, as of the last change.
  using Places = std::unordered_map<int64_t, uint64_t>;
  std::shared_ptr<const Places> places();
  // True if a job that has not ended needs this upload.
  bool uses_scene(const std::string& name);

  // Applies `edit` to the job in one transaction and returns it. A change of state is recorded as
  // an event. What `edit` throws leaves the job as it was. Throws RequestError{kNotFound}
  // if there is no such job.
  Job change(const std::string& id, const std::function<void(Job&)>& edit);
  // Throws RequestError{kConflict} unless the job has ended, {kNotFound} for an unknown job.
  void check_removable(const std::string& id);
  // Throws as check_removable().
  void remove(const std::string& id);

  // The first queued job that may start at `now_s` and is not in `except`. A job that would have to
  // wait for more than `max_wait_s` may start: the clock was set back.
  std::optional<Job> next(double now_s, double max_wait_s, const std::set<std::string>& except);
  // A job that succeeded and has no preview yet.
  std::optional<Job> next_without_preview();
  // After a crash: jobs that are running or canceling, but not among `running`, are queued again,
  // at the front, or canceled. A job that was interrupted often may be the cause: it loses its
  // place at the front and waits `pause_s` before each further attempt (1, 2, ...), and finally it
  // fails. Returns the jobs that have ended.
  std::vector<Job> recover(const std::set<std::string>& running,
                           const std::function<double(unsigned attempt)>& pause_s);
  // Ended jobs that finished before `finished_before_s`, or are not among the `max_count`
  // last-finished jobs of their poster. A poster's jobs never make other posters' jobs expire.
  std::vector<std::string> expired(double finished_before_s, uint64_t max_count);

  // When the last change of a state was recorded; 0 for never.
  double last_event_s();
  std::vector<JobEvent> events_after(const std::string& id, int64_t number);
  // The job that has this key, if there is one. Throws RequestError{kKeyReused} if it came with
  // another request.
  std::optional<Job> find_by_key(const IdempotencyKey& key);

  // Counts the changes of all jobs, and announcements.
  uint64_t version() const;
  // Counts the changes without the announcements.
  uint64_t changes() const;
  // Waits until version() differs from `seen`, or for `max_s` seconds.
  void wait_for_change(uint64_t seen, double max_s) const;
  // Wakes waiting threads as a change does, for events outside the database (progress).
  void announce();

 private:
  // Announces a change; `moves` if it may have moved jobs in the queue.
  void announce_change(bool moves);
  std::vector<Job> query(const std::string& rest, const std::vector<int64_t>& numbers);

  std::mutex write_mutex_;  // guards the next
  SqlDatabase writer_;
  const NamedFile file_;
  std::mutex read_mutex_;  // guards the next
  SqlDatabase reader_;
  SqlStatement find_;

  std::mutex places_mutex_;  // guards the next
  std::shared_ptr<const Places> places_;
  uint64_t places_version_ = 0;

  mutable std::mutex version_mutex_;  // guards the next
  mutable std::condition_variable changed_;
  uint64_t version_ = 1;
  uint64_t changes_ = 1;
  uint64_t queue_version_ = 1;  // counts those that may move jobs in the queue
};

// The error for a request that does not fit the present state of a job.
RequestError state_conflict(const Job& job, const std::string& message);

}  // namespace voxdag::server
