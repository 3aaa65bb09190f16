#include "server/queue/job_rows.h"

#include <nlohmann/json.hpp>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "server/queue/job_queue.h"

namespace voxdag::server {
namespace {

// "vdsv": the queue of a service.
constexpr int64_t kApplicationId = 0x76647376;
constexpr int64_t kSchemaVersion = 2;

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

std::string dump(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

// Every column of a job's row with the member that it stores, in the order of the table.
template <class AnyJob, class Use>
void each_column(AnyJob& job, Use use) {
  use("number", job.number);
  use("id", job.id);
  use("name", job.name);
  use("state", job.state);
  use("request", job.request);
  use("scenes", job.scenes);
  use("posted_by", job.posted_by);
  use("priority", job.priority);
  use("front", job.front);
  use("attempts", job.attempts);
  use("created_s", job.created_s);
  use("started_s", job.started_s);
  use("finished_s", job.finished_s);
  use("not_before_s", job.not_before_s);
  use("error", job.error);
  use("warnings", job.warnings);
  use("result", job.result);
  use("progress", job.progress);
  use("preview", job.preview);
}

// The members of a job as values of SQL, and below each the way back.

template <class Value>
void put(SqlStatement& row, int column, const Value& value) {
  if constexpr (std::is_integral_v<Value> || std::is_enum_v<Value>)
    row.bind(column, static_cast<int64_t>(value));
  else
    row.bind(column, value);
}
template <class Value>
void get(const SqlStatement& row, int column, Value& value) {
  if constexpr (std::is_integral_v<Value> || std::is_enum_v<Value>)
    value = static_cast<Value>(row.integer(column));
  else if constexpr (std::is_same_v<Value, double>)
    value = row.real(column);
  else
    value = row.text(column);
}

void put(SqlStatement& row, int column, const std::vector<std::string>& list) {
  row.bind(column, dump(list));
}
void get(const SqlStatement& row, int column, std::vector<std::string>& list) {
  list = nlohmann::json::parse(row.text(column)).get<std::vector<std::string>>();
}

void put(SqlStatement& row, int column, const std::optional<JobError>& error) {
  row.bind(column, !error ? ""
                          : dump({{"code", error->code},
                                  {"message", error->message},
                                  {"at_s", error->at_s},
                                  {"transient", error->transient}}));
}
void get(const SqlStatement& row, int column, std::optional<JobError>& error) {
  error.reset();
  const std::string text = row.text(column);
  if (text.empty()) return;
  const auto json = nlohmann::json::parse(text);
  error = JobError{json.at("code"), json.at("message"), json.at("at_s"), json.at("transient")};
}

}  // namespace

const std::string& job_columns() {
  static const std::string list = [] {
    std::string text;
    const Job job;
    each_column(job, [&](const char* name, const auto&) {
      text += (text.empty() ? "" : ", ") + std::string(name);
    });
    return text;
  }();
  return list;
}

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
  try {
    each_column(job,
                [&, column = 0](const char*, auto& value) mutable { get(row, column++, value); });
  } catch (const nlohmann::json::exception&) {
    throw Error(ErrorCode::kCorrupt, "the row of job " + job.id + " is damaged");
  }
  return job;
}

std::optional<Job> read_job(SqlDatabase& database, const std::string& id) {
  auto row = database.prepare("SELECT " + job_columns() + " FROM job WHERE id = ?");
  if (!row.bind(0, id).step()) return {};
  return job_of_row(row);
}

void write_job(SqlDatabase& database, const Job& job) {
  // An upsert: replacing the row would remove what refers to it.
  std::string values, updates;
  each_column(job, [&](const char* name, const auto&) {
    values += values.empty() ? "?" : ", ?";
    updates += (updates.empty() ? "" : ", ") + std::string(name) + " = excluded." + name;
  });
  auto row = database.prepare("INSERT INTO job (" + job_columns() + ") VALUES (" + values +
                              ") ON CONFLICT (number) DO UPDATE SET " + updates);
  each_column(
      job, [&, column = 0](const char*, const auto& value) mutable { put(row, column++, value); });
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
