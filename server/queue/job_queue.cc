#include "server/queue/job_queue.h"

#include <chrono>
#include <nlohmann/json.hpp>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/db/table_rows.h"
#include "core/fields/json_text.h"
#include "core/io/random_id.h"
#include "server/base/warning_json.h"
#include "server/disk/store.h"
#include "server/queue/search_sql.h"

namespace voxdag::server {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(JobError, code, message, at_s, transient)

namespace {

constexpr const char* kQueueOrder = "priority DESC, front DESC, number ASC";

// Limits for the number of consecutive runs that ended because the service ended. Above the first
// limit, a job no longer restarts immediately; above the second limit, it fails. With the default
// pauses between these runs, the interruptions must continue for over an hour before the job fails.
constexpr unsigned kFreeInterruptions = 5;
constexpr unsigned kMaxInterruptions = 15;

constexpr int64_t kMaxEvents = 256;  // number of events that are kept of each job

constexpr const char* kSchema = R"sql(
CREATE TABLE job (
  number INTEGER PRIMARY KEY,
  id TEXT NOT NULL UNIQUE,
  name TEXT NOT NULL,
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 6),
  request TEXT NOT NULL,
  scenes TEXT NOT NULL,
  posted_by TEXT NOT NULL,
  priority INTEGER NOT NULL,
  front INTEGER NOT NULL,
  attempts INTEGER NOT NULL,
  interruptions INTEGER NOT NULL DEFAULT 0,
  created_s REAL NOT NULL, started_s REAL NOT NULL, finished_s REAL NOT NULL,
  not_before_s REAL NOT NULL,
  error TEXT NOT NULL,
  warnings TEXT NOT NULL,
  result TEXT NOT NULL,
  progress TEXT NOT NULL,
  preview INTEGER NOT NULL
);
CREATE INDEX job_by_place ON job (state, priority DESC, front DESC, number);
CREATE TABLE job_scene (
  job TEXT NOT NULL REFERENCES job (id) ON DELETE CASCADE,
  scene TEXT NOT NULL,
  PRIMARY KEY (job, scene)
) WITHOUT ROWID;
CREATE INDEX job_scene_by_scene ON job_scene (scene);
CREATE TABLE job_event (
  number INTEGER PRIMARY KEY AUTOINCREMENT,
  job TEXT NOT NULL REFERENCES job (id) ON DELETE CASCADE,
  at_s REAL NOT NULL,
  state INTEGER NOT NULL,
  attempt INTEGER NOT NULL,
  error TEXT NOT NULL
);
CREATE INDEX job_event_by_job ON job_event (job, number);
CREATE TABLE idempotency (
  key TEXT PRIMARY KEY,
  request TEXT NOT NULL,
  job TEXT NOT NULL REFERENCES job (id) ON DELETE CASCADE
);
CREATE INDEX idempotency_by_job ON idempotency (job);
)sql";

// Upgrades a database of version 3, in which a warning was a text.
constexpr const char* kUpgrade = R"sql(
UPDATE job SET warnings = (
  SELECT json_group_array(
      json_object('code', 'build', 'place', '', 'message', value, 'count', 1))
  FROM json_each(job.warnings))
WHERE json_valid(warnings);
)sql";

// Application id "vdsv": the queue of a service.
const StoreFormat kQueueFormat = {"the queue of jobs", "jobs", 0x76647376, 4, kSchema, kUpgrade};

// A row of the table `job`. The columns scenes, error and warnings contain JSON, because SQL has no
// type for them.
struct JobRow {
  Job job;
  std::string scenes, error, warnings;
};

template <class Row>
void fields(Row& row, JobRow& r) {
  Job& job = r.job;
  row("number", job.number);
  row("id", job.id);
  row("name", job.name);
  row("state", job.state);
  row("request", job.request);
  row("scenes", r.scenes);
  row("posted_by", job.posted_by);
  row("priority", job.priority);
  row("front", job.front);
  row("attempts", job.attempts);
  row("interruptions", job.interruptions);
  row("created_s", job.created_s);
  row("started_s", job.started_s);
  row("finished_s", job.finished_s);
  row("not_before_s", job.not_before_s);
  row("error", r.error);
  row("warnings", r.warnings);
  row("result", job.result);
  row("progress", job.progress);
  row("preview", job.preview);
}

JobRow row_of(const Job& job) {
  return {job, json_text(nlohmann::json(job.scenes)),
          job.error ? json_text(nlohmann::json(*job.error)) : "",
          json_text(nlohmann::json(job.warnings))};
}

constexpr const char* kNoRequest = R"({"scene":[],"resolution":0,"options":{}})";

// Returns the job in the current row of a statement from select_rows<JobRow>(). Replaces damaged
// members by defaults and adds a warning to the job. So the job can still be listed and deleted,
// and the damage does not affect other jobs.
Job read_job(const SqlStatement& statement) {
  JobRow row = read_row<JobRow>(statement);
  Job& job = row.job;
  bool damaged = false;
  const auto read = [&](const std::string& text, auto& value) {
    try {
      parse_json<nlohmann::json>(text).get_to(value);
    } catch (const nlohmann::json::exception&) {
      damaged = true;
    }
  };
  const auto check = [&](bool right, auto& value, auto instead) {
    if (right) return;
    value = instead;
    damaged = true;
  };
  const auto is_json = [](const std::string& text) {
    return text.empty() || !try_parse_json<nlohmann::json>(text).is_discarded();
  };
  read(row.scenes, job.scenes);
  read(row.warnings, job.warnings);
  if (!row.error.empty()) read(row.error, job.error.emplace());
  check(static_cast<size_t>(job.state) < kJobStateNames.size(), job.state, JobState::kFailed);
  check(job.request.starts_with('{') && is_json(job.request), job.request, kNoRequest);
  check(is_json(job.progress), job.progress, "");
  check(is_json(job.result), job.result, "");
  if (job.error && job.error->code.empty()) job.error.reset();
  if (damaged)
    job.warnings.push_back({"build", "",
                            "the record of this job in the queue's database is damaged; fields "
                            "that cannot be read have default values"});
  return std::move(job);
}

std::optional<Job> find_job(SqlDatabase& database, const std::string& id) {
  auto rows = select_rows<JobRow>(database, "job", "WHERE id = ?");
  if (!rows.bind(0, id).step()) return {};
  return read_job(rows);
}

// Records the current state of the job as its newest event. Keeps only the newest events of a job,
// because a client can suspend and resume a job any number of times.
void write_event(SqlDatabase& database, const Job& job) {
  database
      .prepare("INSERT INTO job_event (job, at_s, state, attempt, error) VALUES (?, ?, ?, ?, ?)")
      .bind(0, job.id)
      .bind(1, unix_seconds())
      .bind(2, static_cast<int64_t>(job.state))
      .bind(3, int64_t{job.attempts})
      .bind(4, job.error ? job.error->code : std::string())
      .run();
  database
      .prepare(
          "DELETE FROM job_event WHERE job = ?1 AND number <= (SELECT number FROM job_event "
          "WHERE job = ?1 ORDER BY number DESC LIMIT 1 OFFSET ?2)")
      .bind(0, job.id)
      .bind(1, kMaxEvents)
      .run();
}

// Returns the SQL condition for a list of states. States are stored as numbers, so they need not be
// bound as parameters.
std::string states_in(const std::vector<JobState>& states) {
  std::string list;
  for (const JobState state : states)
    list += (list.empty() ? "" : ", ") + std::to_string(static_cast<int>(state));
  return "state IN (" + list + ")";
}

const std::string kEnded = "state >= " + std::to_string(static_cast<int>(JobState::kCanceled));
const std::string kOpen = "state < " + std::to_string(static_cast<int>(JobState::kCanceled));

std::optional<Job> job_of_key(SqlDatabase& database, const IdempotencyKey& key) {
  if (key.key.empty()) return {};
  auto known = database.prepare("SELECT job, request FROM idempotency WHERE key = ?");
  if (!known.bind(0, key.key).step()) return {};
  if (known.text(1) != key.request)
    throw RequestError(
        RequestError::Kind::kKeyReused,
        "this Idempotency-Key was already used with a different request: expected a new key");
  return find_job(database, known.text(0));
}

RequestError no_job(const std::string& id) {
  return {RequestError::Kind::kNotFound,
          "no such job: '" + id.substr(0, 32) + "': expected the id of a job that was not deleted"};
}

void expect_ended(const std::optional<Job>& job, const std::string& id) {
  if (!job) throw no_job(id);
  if (!has_ended(job->state))
    throw state_conflict(*job, "expected a job that has ended; cancel it first");
}

}  // namespace

RequestError state_conflict(const Job& job, const std::string& message) {
  RequestError error(RequestError::Kind::kConflict,
                     std::string("the job is ") + state_name(job.state) + ": " + message);
  error.job_state = state_name(job.state);
  return error;
}

std::optional<JobState> parse_state(std::string_view name) {
  for (size_t i = 0; i < kJobStateNames.size(); ++i)
    if (name == kJobStateNames[i]) return static_cast<JobState>(i);
  return {};
}

JobQueue::JobQueue(const std::string& path, bool may_create)
    : writer_(open_store(path, kQueueFormat, may_create)),
      file_(path),
      reader_(path, SqlDatabase::Mode::kReadOnly),
      find_(select_rows<JobRow>(reader_, "job", "WHERE id = ?")) {}

JobQueue::Added JobQueue::add(Job job, const IdempotencyKey& key, uint64_t max_open) {
  check_file();
  Added added;
  {
    std::lock_guard lock(write_mutex_);
    SqlTransaction transaction(writer_);
    if (auto known = job_of_key(writer_, key)) return {std::move(*known), true};
    if (static_cast<uint64_t>(writer_.integer("SELECT count(*) FROM job WHERE " + kOpen)) >=
        max_open)
      throw RequestError(RequestError::Kind::kBusy, "the queue is full: expected less than " +
                                                        std::to_string(max_open) +
                                                        " jobs that have not ended");
    if (job.id.empty()) job.id = random_id();
    job.number = writer_.integer("SELECT coalesce(max(number), 0) + 1 FROM job");
    if (job.created_s == 0) job.created_s = unix_seconds();
    put_row(writer_, "job", row_of(job));
    for (const std::string& scene : job.scenes)
      writer_.prepare("INSERT OR IGNORE INTO job_scene VALUES (?, ?)")
          .bind(0, job.id)
          .bind(1, scene)
          .run();
    write_event(writer_, job);
    if (!key.key.empty())
      writer_.prepare("INSERT INTO idempotency VALUES (?, ?, ?)")
          .bind(0, key.key)
          .bind(1, key.request)
          .bind(2, job.id)
          .run();
    transaction.commit();
    added.job = std::move(job);
  }
  announce_change(true);
  return added;
}

std::optional<Job> JobQueue::find(const std::string& id) {
  std::lock_guard lock(read_mutex_);
  std::optional<Job> job;
  find_.reset();  // needed if the previous call of find() has thrown
  if (find_.bind(0, id).step()) job = read_job(find_);
  find_.reset();
  return job;
}

std::optional<Job> JobQueue::find_by_key(const IdempotencyKey& key) {
  std::lock_guard lock(read_mutex_);
  return job_of_key(reader_, key);
}

std::vector<Job> JobQueue::query(const std::string& rest, const std::vector<int64_t>& numbers) {
  std::lock_guard lock(read_mutex_);
  auto rows = select_rows<JobRow>(reader_, "job", rest);
  for (size_t i = 0; i < numbers.size(); ++i) rows.bind(static_cast<int>(i), numbers[i]);
  std::vector<Job> jobs;
  while (rows.step()) jobs.push_back(read_job(rows));
  return jobs;
}

std::vector<Job> JobQueue::list(const JobFilter& filter) {
  const std::string states = filter.states.empty() ? "" : " AND " + states_in(filter.states);
  std::lock_guard lock(read_mutex_);
  auto rows = select_rows<JobRow>(reader_, "job",
                                  "WHERE number < ?1" + states + " AND " + kHasWords + " AND " +
                                      kHasLabel + " ORDER BY number DESC LIMIT ?2");
  rows.bind(0, filter.before)
      .bind(1, static_cast<int64_t>(filter.limit))
      .bind(2, filter.words)
      .bind(3, filter.label);
  std::vector<Job> jobs;
  while (rows.step()) jobs.push_back(read_job(rows));
  return jobs;
}

std::map<JobState, uint64_t> JobQueue::counts() {
  std::lock_guard lock(read_mutex_);
  auto rows = reader_.prepare("SELECT state, count(*) FROM job GROUP BY state");
  std::map<JobState, uint64_t> counts;
  while (rows.step())
    counts[static_cast<JobState>(rows.integer(0))] = static_cast<uint64_t>(rows.integer(1));
  return counts;
}

std::shared_ptr<const JobQueue::Places> JobQueue::places() {
  std::lock_guard lock(places_mutex_);
  uint64_t now;
  {
    std::lock_guard version_lock(version_mutex_);
    now = queue_version_;
  }
  if (places_ && places_version_ == now) return places_;
  auto places = std::make_shared<Places>();
  {
    std::lock_guard read_lock(read_mutex_);
    auto rows = reader_.prepare("SELECT number FROM job WHERE " + states_in({JobState::kQueued}) +
                                " ORDER BY " + kQueueOrder);
    while (rows.step()) places->emplace(rows.integer(0), places->size() + 1);
  }
  places_version_ = now;
  return places_ = std::move(places);
}

bool JobQueue::uses_scene(const std::string& name) {
  std::lock_guard lock(write_mutex_);
  auto rows = writer_.prepare(
      "SELECT 1 FROM job_scene JOIN job ON job.id = job_scene.job WHERE job_scene.scene = ? AND " +
      kOpen + " LIMIT 1");
  return rows.bind(0, name).step();
}

Job JobQueue::change(const std::string& id, const std::function<void(Job&)>& edit) {
  Job job;
  bool moves = false;
  {
    std::lock_guard lock(write_mutex_);
    SqlTransaction transaction(writer_);
    const auto found = find_job(writer_, id);
    if (!found) throw no_job(id);
    job = *found;
    edit(job);
    update_row(writer_, "job", "number = " + std::to_string(job.number), row_of(job));
    if (job.state != found->state) write_event(writer_, job);
    moves = job.state != found->state || job.priority != found->priority;
    transaction.commit();
  }
  announce_change(moves);
  return job;
}

void JobQueue::check_removable(const std::string& id) { expect_ended(find(id), id); }

void JobQueue::remove(const std::string& id) {
  {
    std::lock_guard lock(write_mutex_);
    SqlTransaction transaction(writer_);
    expect_ended(find_job(writer_, id), id);
    writer_.prepare("DELETE FROM job WHERE id = ?").bind(0, id).run();
    transaction.commit();
  }
  announce_change(true);
}

std::optional<Job> JobQueue::next(double now_s, double max_wait_s,
                                  const std::set<std::string>& except) {
  // Reads one job more than `except` contains. So if the query finds this many jobs, at least one
  // of them is not in `except`. Few jobs are read, because `except` contains only jobs that have a
  // process or whose files are being removed.
  const auto jobs =
      query("WHERE " + states_in({JobState::kQueued}) +
                " AND (not_before_s <= " + std::to_string(now_s) + " OR not_before_s > " +
                std::to_string(now_s + max_wait_s) + ") ORDER BY " + kQueueOrder + " LIMIT ?",
            {static_cast<int64_t>(except.size() + 1)});
  for (const Job& job : jobs)
    if (!except.contains(job.id)) return job;
  return {};
}

std::optional<Job> JobQueue::next_without_preview() {
  const auto jobs = query("WHERE " + states_in({JobState::kSucceeded}) +
                              " AND preview = 0 ORDER BY number DESC LIMIT 1",
                          {});
  if (jobs.empty()) return {};
  return jobs[0];
}

std::vector<Job> JobQueue::recover(const std::set<std::string>& running,
                                   const std::function<double(unsigned attempt)>& pause_s) {
  std::vector<Job> ended;
  for (const Job& found :
       query("WHERE " + states_in({JobState::kRunning, JobState::kCanceling}) + " ORDER BY number",
             {})) {
    if (running.contains(found.id)) continue;
    const Job job = change(found.id, [&](Job& j) {
      const bool cancels = j.state == JobState::kCanceling;
      const bool is_suspect = !cancels && ++j.interruptions > kFreeInterruptions;
      const bool fails = is_suspect && j.interruptions > kMaxInterruptions;
      j.state = cancels ? JobState::kCanceled : fails ? JobState::kFailed : JobState::kQueued;
      j.front = j.state == JobState::kQueued && !is_suspect;
      if (is_suspect && !fails)
        j.not_before_s = unix_seconds() + pause_s(j.interruptions - kFreeInterruptions);
      if (has_ended(j.state)) j.finished_s = unix_seconds();
      if (fails)
        j.error = JobError{"internal",
                           "the service ended " + std::to_string(j.interruptions) +
                               " times while this job ran, perhaps because of it",
                           unix_seconds(), false};
    });
    if (has_ended(job.state)) ended.push_back(job);
  }
  return ended;
}

std::vector<std::string> JobQueue::expired(double finished_before_s, uint64_t max_count) {
  std::lock_guard lock(read_mutex_);
  auto rows = reader_.prepare(
      "SELECT id FROM (SELECT id, finished_s, row_number() OVER (PARTITION BY posted_by "
      "ORDER BY finished_s DESC, number DESC) AS place FROM job WHERE " +
      kEnded + ") WHERE finished_s < ? OR place > ? ORDER BY finished_s");
  rows.bind(0, finished_before_s).bind(1, static_cast<int64_t>(max_count));
  std::vector<std::string> ids;
  while (rows.step()) ids.push_back(rows.text(0));
  return ids;
}

double JobQueue::last_event_s() {
  std::lock_guard lock(read_mutex_);
  auto rows = reader_.prepare("SELECT at_s FROM job_event ORDER BY number DESC LIMIT 1");
  return rows.step() ? rows.real(0) : 0;
}

std::vector<JobEvent> JobQueue::events_after(const std::string& id, int64_t number) {
  std::lock_guard lock(read_mutex_);
  auto rows = reader_.prepare(
      "SELECT * FROM (SELECT number, at_s, state, attempt, error FROM job_event WHERE job = ? AND "
      "number > ? ORDER BY number DESC LIMIT ?) ORDER BY number");
  rows.bind(0, id).bind(1, number).bind(2, kMaxEvents);
  std::vector<JobEvent> events;
  while (rows.step())
    events.push_back({rows.integer(0), rows.real(1), static_cast<JobState>(rows.integer(2)),
                      static_cast<unsigned>(rows.integer(3)), rows.text(4)});
  return events;
}

uint64_t JobQueue::version() const {
  std::lock_guard lock(version_mutex_);
  return version_;
}

void JobQueue::wait_for_change(uint64_t seen, double max_s) const {
  std::unique_lock lock(version_mutex_);
  changed_.wait_for(lock, std::chrono::duration<double>(max_s), [&] { return version_ != seen; });
}

void JobQueue::announce() {
  {
    std::lock_guard lock(version_mutex_);
    ++version_;
  }
  changed_.notify_all();
}

void JobQueue::announce_change(bool moves) {
  {
    std::lock_guard lock(version_mutex_);
    ++changes_;
    queue_version_ += moves;
  }
  announce();
}

uint64_t JobQueue::changes() const {
  std::lock_guard lock(version_mutex_);
  return changes_;
}

}  // namespace voxdag::server
