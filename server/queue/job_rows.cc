#include "server/queue/job_rows.h"

#include <nlohmann/json.hpp>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "server/queue/job_queue.h"

namespace voxdag::server {
namespace {

// "vdsv": a service's queue, not a build's job store.
constexpr int64_t kApplicationId = 0x76647376;
constexpr int64_t kSchemaVersion = 1;

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

std::string error_text(const std::optional<JobError>& error) {
  if (!error) return "";
  return nlohmann::json::array({error->code, error->message, error->at_s, error->transient})
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::optional<JobError> error_of(const std::string& text) {
  if (text.empty()) return {};
  const auto json = nlohmann::json::parse(text);
  return JobError{json.at(0), json.at(1), json.at(2), json.at(3)};
}

std::string list_text(const std::vector<std::string>& list) {
  return nlohmann::json(list).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

const char* const kJobColumns =
    "number, id, name, state, request, scenes, posted_by, priority, front, attempts, created_s, "
    "started_s, finished_s, not_before_s, error, warnings, result, progress, preview";

void prepare_schema(SqlDatabase& database, const std::string& path) {
  const int64_t application = database.integer("PRAGMA application_id");
  const int64_t version = database.integer("PRAGMA user_version");
  const bool fresh = application == 0 && version == 0 &&
                     database.integer("SELECT count(*) FROM sqlite_master") == 0;
  if (!fresh && application != kApplicationId)
    throw Error(ErrorCode::kInvalidInput, path + ": expected a queue of voxdag serve");
  if (!fresh && version != kSchemaVersion)
    throw Error(ErrorCode::kUnsupportedVersion, path + ": the queue's version is " +
                                                    std::to_string(version) + ", expected " +
                                                    std::to_string(kSchemaVersion));
  database.execute("PRAGMA journal_mode = WAL");
  database.execute("PRAGMA foreign_keys = ON");
  if (!fresh) return;
  SqlTransaction transaction(database);
  database.execute(kSchema);
  database.execute("PRAGMA application_id = " + std::to_string(kApplicationId));
  database.execute("PRAGMA user_version = " + std::to_string(kSchemaVersion));
  transaction.commit();
}

Job job_of_row(const SqlStatement& row) {
  Job job;
  job.number = row.integer(0);
  job.id = row.text(1);
  job.name = row.text(2);
  job.state = static_cast<JobState>(row.integer(3));
  job.request = row.text(4);
  job.posted_by = row.text(6);
  job.priority = static_cast<int>(row.integer(7));
  job.front = row.integer(8) != 0;
  job.attempts = static_cast<unsigned>(row.integer(9));
  job.created_s = row.real(10);
  job.started_s = row.real(11);
  job.finished_s = row.real(12);
  job.not_before_s = row.real(13);
  job.result = row.text(16);
  job.progress = row.text(17);
  job.preview = static_cast<Preview>(row.integer(18));
  try {
    job.scenes = nlohmann::json::parse(row.text(5)).get<std::vector<std::string>>();
    job.error = error_of(row.text(14));
    job.warnings = nlohmann::json::parse(row.text(15)).get<std::vector<std::string>>();
  } catch (const nlohmann::json::exception&) {
    throw Error(ErrorCode::kCorrupt, "the row of job " + job.id + " is damaged");
  }
  return job;
}

std::optional<Job> read_job(SqlDatabase& database, const std::string& id) {
  auto row = database.prepare("SELECT " + std::string(kJobColumns) + " FROM job WHERE id = ?");
  if (!row.bind(0, id).step()) return {};
  return job_of_row(row);
}

void write_job(SqlDatabase& database, const Job& job) {
  // An upsert: replacing the row would take what refers to it along.
  auto row = database.prepare(
      "INSERT INTO job VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, "
      "?16, ?17, ?18, ?19) ON CONFLICT (number) DO UPDATE SET name = ?3, state = ?4, priority = "
      "?8, front = ?9, attempts = ?10, started_s = ?12, finished_s = ?13, not_before_s = ?14, "
      "error = ?15, warnings = ?16, result = ?17, progress = ?18, preview = ?19");
  row.bind(0, job.number).bind(1, job.id).bind(2, job.name);
  row.bind(3, static_cast<int64_t>(job.state)).bind(4, job.request);
  row.bind(5, list_text(job.scenes)).bind(6, job.posted_by);
  row.bind(7, int64_t{job.priority}).bind(8, int64_t{job.front}).bind(9, int64_t{job.attempts});
  row.bind(10, job.created_s).bind(11, job.started_s).bind(12, job.finished_s);
  row.bind(13, job.not_before_s).bind(14, error_text(job.error)).bind(15, list_text(job.warnings));
  row.bind(16, job.result).bind(17, job.progress).bind(18, static_cast<int64_t>(job.preview));
  row.run();
  for (const std::string& scene : job.scenes)
    database.prepare("INSERT OR IGNORE INTO job_scene VALUES (?, ?)")
        .bind(0, job.id)
        .bind(1, scene)
        .run();
}

void write_event(SqlDatabase& database, const Job& job) {
  database
      .prepare("INSERT INTO job_event (job, at_s, state, attempt, error) VALUES (?, ?, ?, ?, ?)")
      .bind(0, job.id)
      .bind(1, unix_seconds())
      .bind(2, static_cast<int64_t>(job.state))
      .bind(3, int64_t{job.attempts})
      .bind(4, job.error ? job.error->code : std::string())
      .run();
}

}  // namespace voxdag::server
