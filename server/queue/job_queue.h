// The service's jobs, stored durably in one SQLite file (WAL, synchronous = FULL). When a call
// returns, its changes are committed. A SIGKILL between any two instructions leaves every job in a
// state that recover() repairs.
//
// Order of the queue: by priority; jobs of equal priority that were running before come first; then
// by the order of submission. Thread-safe; readers never wait for a writer's sync.
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
  std::vector<JobState> states;  // empty: all states
  int64_t before = INT64_MAX;    // only jobs with smaller numbers
  size_t limit = 50;
  // Only jobs whose name, scenes or labels contain this text, or whose id begins with it. Case does
  // not matter for ASCII letters. "": all jobs.
  std::string words;
  std::string label;  // only jobs with this label; "": all jobs
};

struct IdempotencyKey {
  std::string key;      // "": no key
  std::string request;  // digest of the request
};

class JobQueue {
 public:
  // Opens the database at `path`. Creates it if it is missing and `may_create` is set. Throws
  // Error{kCorrupt} for a damaged database, Error{kUnsupportedVersion} for a version that this
  // program cannot read, and Error{kInvalidInput} for a database of another program. Also throws
  // Error{kInvalidInput} if the database is missing and `may_create` is not set.
  explicit JobQueue(const std::string& path, bool may_create = true);
  // Throws Error{kIo} if the database was removed or replaced.
  void check_file() const { file_.check(); }

  struct Added {
    Job job;
    bool replayed = false;
  };
  // Queues the job under its id, or under a new id if it has none. If a job was already added with
  // this key, returns that job instead. Throws RequestError: kKeyReused if the key was used with a
  // different request, kBusy if `max_open` unfinished jobs exist.
  Added add(Job job, const IdempotencyKey& key, uint64_t max_open);

  std::optional<Job> find(const std::string& id);
  // Returns jobs, newest first.
  std::vector<Job> list(const JobFilter& filter);
  std::map<JobState, uint64_t> counts();
  // Positions in the queue, counted from 1, by job number. They are valid as of the last change.
  using Places = std::unordered_map<int64_t, uint64_t>;
  std::shared_ptr<const Places> places();
  // True if an unfinished job needs this upload.
  bool uses_scene(const std::string& name);

  // Applies `edit` to the job in one transaction and returns the job. A change of state is recorded
  // as an event. If `edit` throws, the job is unchanged. Throws RequestError{kNotFound} if there is
  // no such job.
  Job change(const std::string& id, const std::function<void(Job&)>& edit);
  // Throws RequestError{kConflict} unless the job has ended, RequestError{kNotFound} for an unknown
  // job.
  void check_removable(const std::string& id);
  // Throws like check_removable().
  void remove(const std::string& id);

  // Returns the first queued job that may start at `now_s` and is not in `except`. A job may start
  // at its not_before_s, or immediately if it would have to wait longer than `max_wait_s`: such a
  // wait means that the clock was set back.
  std::optional<Job> next(double now_s, double max_wait_s, const std::set<std::string>& except);
  // Returns a job that succeeded and has no preview yet.
  std::optional<Job> next_without_preview();
  // Repairs states after a crash. `running` has the ids of the jobs whose processes are known to
  // run; these jobs are not changed. All other jobs in the state running are queued again, at the
  // front. All other jobs in the state canceling become canceled. A job that was interrupted often
  // is possibly the cause of the interruptions. Such a job is not queued at the front, waits for
  // pause_s(attempt) seconds before each further attempt (1, 2, ...), and finally fails. Returns
  // the jobs that have ended by this call.
  std::vector<Job> recover(const std::set<std::string>& running,
                           const std::function<double(unsigned attempt)>& pause_s);
  // Returns the ids of the ended jobs that finished before `finished_before_s`. For each
  // Job::posted_by, also returns all ended jobs except the `max_count` jobs that finished last. So
  // the jobs of one client never make other clients' jobs expire.
  std::vector<std::string> expired(double finished_before_s, uint64_t max_count);

  // Returns the Unix time of the last recorded change of a job's state; 0 if there is none.
  double last_event_s();
  // Returns the events of a job whose numbers are above `number`, oldest first. If there are more
  // than 256, returns only the last 256.
  std::vector<JobEvent> events_after(const std::string& id, int64_t number);
  // Returns the job that was added with this key; nullopt if none exists. Throws
  // RequestError{kKeyReused} if the key was used with a different request.
  std::optional<Job> find_by_key(const IdempotencyKey& key);

  // Returns the number of changes of all jobs, including calls of announce().
  uint64_t version() const;
  // Returns the number of changes of all jobs, without calls of announce().
  uint64_t changes() const;
  // Waits until version() differs from `seen`, or for `max_s` seconds.
  void wait_for_change(uint64_t seen, double max_s) const;
  // Wakes the threads in wait_for_change(), as a change does. Call it after events outside the
  // database, such as progress.
  void announce();

 private:
  // Announces a change of the database. `moves`: the change may have moved jobs in the queue.
  void announce_change(bool moves);
  std::vector<Job> query(const std::string& rest, const std::vector<int64_t>& numbers);

  std::mutex write_mutex_;  // guards writer_
  SqlDatabase writer_;
  const NamedFile file_;
  std::mutex read_mutex_;  // guards reader_ and find_
  SqlDatabase reader_;
  SqlStatement find_;

  std::mutex places_mutex_;  // guards places_ and places_version_
  std::shared_ptr<const Places> places_;
  uint64_t places_version_ = 0;  // queue_version_ for which places_ was computed

  mutable std::mutex version_mutex_;  // guards all members below
  mutable std::condition_variable changed_;
  uint64_t version_ = 1;
  uint64_t changes_ = 1;
  uint64_t queue_version_ = 1;  // number of changes that may have moved jobs in the queue
};

// Returns the error for a request that is invalid in the job's current state.
RequestError state_conflict(const Job& job, const std::string& message);

}  // namespace voxdag::server
