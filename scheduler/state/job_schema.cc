#include "scheduler/state/job_schema.h"

#include "core/base/error.h"
#include "core/db/table_rows.h"

namespace voxdag {
namespace {

// "vdag": marks a database as a job store.
constexpr int64_t kApplicationId = 0x76646167;

constexpr int64_t kSchemaVersion = 9;

constexpr const char* kTables = R"sql(
CREATE TABLE job (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  scene_digest TEXT NOT NULL,
  geometry TEXT NOT NULL,
  format_version INTEGER NOT NULL,
  -- Number of subvolumes. Their ids are 1, 2, ...
  subvolumes INTEGER NOT NULL,
  row_checksum INTEGER NOT NULL
);
CREATE TABLE subvolume (
  id INTEGER PRIMARY KEY,
  parent INTEGER REFERENCES subvolume (id),
  level INTEGER NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL, z INTEGER NOT NULL,
  weight REAL NOT NULL,
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 2),
  segment INTEGER NOT NULL, offset INTEGER NOT NULL, bytes INTEGER NOT NULL,
  index_offset INTEGER NOT NULL, checksum INTEGER NOT NULL,
  voxels INTEGER NOT NULL, svo_nodes INTEGER NOT NULL, dag_nodes INTEGER NOT NULL,
  root_hash INTEGER NOT NULL, interior INTEGER NOT NULL, disputed INTEGER NOT NULL,
  row_checksum INTEGER NOT NULL
);
-- Replacing a row searches for rows that refer to it. Without this index SQLite reads all rows.
CREATE INDEX subvolume_by_parent ON subvolume (parent);
CREATE TABLE stage_time (
  id INTEGER PRIMARY KEY,
  name TEXT NOT NULL, wall_s REAL NOT NULL, cpu_s REAL NOT NULL,
  largest_thread_share REAL NOT NULL
);
CREATE TABLE progress (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  stage TEXT NOT NULL, unit TEXT NOT NULL, done INTEGER NOT NULL, total INTEGER NOT NULL,
  resumed_at INTEGER NOT NULL,
  stage_started_s REAL NOT NULL, updated_s REAL NOT NULL,
  memory_bytes INTEGER NOT NULL, disk_bytes INTEGER NOT NULL, last_error TEXT NOT NULL
);
-- An unfinished merge, and the file that a finished one is about to publish.
CREATE TABLE merge (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  level INTEGER NOT NULL,
  state BLOB NOT NULL,
  row_checksum INTEGER NOT NULL
);
CREATE TABLE result (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  output TEXT NOT NULL, sha256 TEXT NOT NULL, bytes INTEGER NOT NULL,
  voxels INTEGER NOT NULL, svo_nodes INTEGER NOT NULL, dag_nodes INTEGER NOT NULL,
  merge_passes INTEGER NOT NULL, merge_partitions INTEGER NOT NULL,
  merge_streamed_groups INTEGER NOT NULL, sections TEXT NOT NULL,
  row_checksum INTEGER NOT NULL
);
-- The progress of scan, ingest and partition; the triangles are in a file.
CREATE TABLE ingest (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  record BLOB NOT NULL,
  row_checksum INTEGER NOT NULL
);
-- The warnings about the scene so far. Nothing that determines the result.
CREATE TABLE warning (
  id INTEGER PRIMARY KEY,
  code TEXT NOT NULL, place TEXT NOT NULL, message TEXT NOT NULL, count INTEGER NOT NULL
);
)sql";

void check_integrity(SqlDatabase& database) {
  auto check = database.prepare("PRAGMA integrity_check(1)");
  std::string found = check.step() ? check.text(0) : "no answer";
  if (found == "ok") return;
  // SQLite's text can begin with a heading.
  if (found.starts_with("***")) found.erase(0, found.find('\n') + 1);
  throw Error(ErrorCode::kCorrupt, "it is damaged (" + found + ")");
}

}  // namespace

void check_job_schema(SqlDatabase& database, const std::string& path) {
  if (database.integer("PRAGMA application_id") != kApplicationId)
    throw Error(ErrorCode::kInvalidInput,
                path + " is not a job store of voxdag: expected the job.db of a build");
  const int64_t version = database.integer("PRAGMA user_version");
  if (version != kSchemaVersion)
    throw Error(ErrorCode::kUnsupportedVersion,
                path + " is a job store of version " + std::to_string(version) +
                    ": expected version " + std::to_string(kSchemaVersion));
}

void prepare_job_schema(SqlDatabase& database, const std::string& path) {
  const bool empty = is_new(database);
  if (!empty) check_job_schema(database, path);
  database.execute("PRAGMA journal_mode = WAL");
  database.execute("PRAGMA foreign_keys = ON");
  if (!empty) return check_integrity(database);
  change_schema(database, kTables, kApplicationId, kSchemaVersion);
}

}  // namespace voxdag
