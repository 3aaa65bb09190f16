#include "scheduler/job_store.h"

#include <algorithm>

#include "core/base/error.h"

namespace voxdag {
namespace {

// "vdag": tells our databases from others.
constexpr int64_t kApplicationId = 0x76646167;

constexpr const char* kSchema = R"sql(
CREATE TABLE job (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  scene_sha256 TEXT NOT NULL,
  geometry TEXT NOT NULL,
  format_version INTEGER NOT NULL
);
CREATE TABLE subvolume (
  id INTEGER PRIMARY KEY,
  parent INTEGER REFERENCES subvolume (id),
  level INTEGER NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL, z INTEGER NOT NULL,
  weight REAL NOT NULL,
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 2),
  segment INTEGER, offset INTEGER, bytes INTEGER, index_offset INTEGER, checksum INTEGER,
  voxels INTEGER, svo_nodes INTEGER, dag_nodes INTEGER, root_hash INTEGER
);
CREATE INDEX subvolume_state ON subvolume (state);
CREATE TABLE stage_time (
  id INTEGER PRIMARY KEY,
  name TEXT NOT NULL, wall_s REAL NOT NULL, cpu_s REAL NOT NULL
);
CREATE TABLE progress (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  stage TEXT NOT NULL, unit TEXT NOT NULL, done INTEGER NOT NULL, total INTEGER NOT NULL,
  stage_started_s REAL NOT NULL, updated_s REAL NOT NULL,
  memory_bytes INTEGER NOT NULL, disk_bytes INTEGER NOT NULL, last_error TEXT NOT NULL
);
)sql";

void insert_planned(SqlStatement& insert, const Cube& cube, double weight) {
  insert.bind(0, int64_t{cube.level});
  for (int a = 0; a < 3; ++a) insert.bind(1 + a, int64_t{cube.position[a]});
  insert.bind(4, weight);
}

StoredSubvolume read_subvolume(const SqlStatement& row) {
  StoredSubvolume s;
  s.id = row.integer(0);
  s.cube.level = static_cast<uint32_t>(row.integer(1));
  for (int a = 0; a < 3; ++a) s.cube.position[a] = static_cast<uint32_t>(row.integer(2 + a));
  s.weight = row.real(5);
  s.state = static_cast<SubvolumeState>(row.integer(6));
  s.artifact = {static_cast<uint32_t>(row.integer(7)), row.word(8), row.word(9), row.word(10),
                row.word(11)};
  s.summary = {row.word(12), row.word(13), row.word(14), row.word(15)};
  return s;
}

}  // namespace

JobStore::JobStore(const std::string& path, Access access)
    : database_(path, access == Access::kBuild ? SqlDatabase::Mode::kReadWrite
                                               : SqlDatabase::Mode::kReadOnly) {
  if (access == Access::kBuild) {
    database_.execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;");
    database_.execute("PRAGMA foreign_keys = ON;");
  }
  const int64_t application = database_.integer("PRAGMA application_id");
  const int64_t version = database_.integer("PRAGMA user_version");
  const bool fresh = application == 0 && version == 0 &&
                     database_.integer("SELECT count(*) FROM sqlite_master") == 0;
  if (fresh && access == Access::kBuild) {
    SqlTransaction transaction(database_);
    database_.execute(kSchema);
    database_.execute("PRAGMA application_id = " + std::to_string(kApplicationId));
    database_.execute("PRAGMA user_version = " + std::to_string(kSchemaVersion));
    transaction.commit();
    return;
  }
  if (application != kApplicationId)
    throw Error(ErrorCode::kInvalidInput, path + " is not a job store of voxdag");
  if (version != kSchemaVersion)
    throw Error(ErrorCode::kUnsupportedVersion,
                path + " is a job store of version " + std::to_string(version) +
                    ": expected version " + std::to_string(kSchemaVersion));
}

std::optional<JobIdentity> JobStore::job() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare("SELECT scene_sha256, geometry, format_version FROM job");
  if (!query.step()) return std::nullopt;
  return JobIdentity{query.text(0), query.text(1), query.integer(2)};
}

void JobStore::start(const JobIdentity& job, std::span<const StoredSubvolume> plan) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.execute("UPDATE subvolume SET parent = NULL; DELETE FROM subvolume;");
  database_.execute("DELETE FROM job; DELETE FROM stage_time; DELETE FROM progress;");
  database_.prepare("INSERT INTO job VALUES (1, ?, ?, ?)")
      .bind(0, job.scene_sha256)
      .bind(1, job.geometry)
      .bind(2, job.format_version)
      .run();
  auto insert = database_.prepare(
      "INSERT INTO subvolume (level, x, y, z, weight, state) VALUES (?, ?, ?, ?, ?, 0)");
  for (const StoredSubvolume& subvolume : plan) {
    insert_planned(insert, subvolume.cube, subvolume.weight);
    insert.run();
  }
  transaction.commit();
}

std::vector<StoredSubvolume> JobStore::leaves() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare(
      "SELECT id, level, x, y, z, weight, state, segment, offset, bytes, index_offset, checksum, "
      "voxels, svo_nodes, dag_nodes, root_hash FROM subvolume WHERE state <> 2 ORDER BY id");
  std::vector<StoredSubvolume> leaves;
  while (query.step()) leaves.push_back(read_subvolume(query));
  return leaves;
}

void JobStore::record_built(std::span<const StoredSubvolume> built) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  auto update = database_.prepare(
      "UPDATE subvolume SET state = 1, segment = ?, offset = ?, bytes = ?, index_offset = ?, "
      "checksum = ?, voxels = ?, svo_nodes = ?, dag_nodes = ?, root_hash = ? WHERE id = ?");
  for (const StoredSubvolume& s : built)
    update.bind(0, int64_t{s.artifact.segment})
        .bind_word(1, s.artifact.offset)
        .bind_word(2, s.artifact.bytes)
        .bind_word(3, s.artifact.index_offset)
        .bind_word(4, s.artifact.checksum)
        .bind_word(5, s.summary.voxels)
        .bind_word(6, s.summary.svo_nodes)
        .bind_word(7, s.summary.dag_nodes)
        .bind_word(8, s.summary.root_hash)
        .bind(9, s.id)
        .run();
  transaction.commit();
}

std::vector<SubvolumeId> JobStore::record_split(SubvolumeId whole, std::span<const Cube> parts) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  auto weight = database_.prepare("SELECT weight FROM subvolume WHERE id = ?");
  weight.bind(0, whole).step();
  const double part_weight =
      weight.real(0) / static_cast<double>(std::max<size_t>(parts.size(), 1));
  database_.prepare("UPDATE subvolume SET state = 2 WHERE id = ?").bind(0, whole).run();
  auto insert = database_.prepare(
      "INSERT INTO subvolume (level, x, y, z, weight, state, parent) VALUES (?, ?, ?, ?, ?, 0, ?)");
  std::vector<SubvolumeId> ids;
  for (const Cube& cube : parts) {
    insert_planned(insert, cube, part_weight);
    insert.bind(5, whole).run();
    ids.push_back(database_.integer("SELECT last_insert_rowid()"));
  }
  transaction.commit();
  return ids;
}

void JobStore::record_lost(SubvolumeId id) {
  std::lock_guard lock(mutex_);
  database_.prepare("UPDATE subvolume SET state = 0 WHERE id = ?").bind(0, id).run();
}

void JobStore::add_stage_time(const StageTime& time) {
  std::lock_guard lock(mutex_);
  database_.prepare("INSERT INTO stage_time (name, wall_s, cpu_s) VALUES (?, ?, ?)")
      .bind(0, time.name)
      .bind(1, time.wall_s)
      .bind(2, time.cpu_s)
      .run();
}

std::vector<StageTime> JobStore::stage_times() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare("SELECT name, wall_s, cpu_s FROM stage_time ORDER BY id");
  std::vector<StageTime> times;
  while (query.step()) times.push_back({query.text(0), query.real(1), query.real(2)});
  return times;
}

void JobStore::set_progress(const ProgressSnapshot& p) {
  std::lock_guard lock(mutex_);
  database_.prepare("INSERT OR REPLACE INTO progress VALUES (1, ?, ?, ?, ?, ?, ?, ?, ?, ?)")
      .bind(0, p.stage)
      .bind(1, p.unit)
      .bind_word(2, p.done)
      .bind_word(3, p.total)
      .bind(4, p.stage_started_s)
      .bind(5, p.updated_s)
      .bind_word(6, p.memory_bytes)
      .bind_word(7, p.disk_bytes)
      .bind(8, p.last_error)
      .run();
}

std::optional<ProgressSnapshot> JobStore::progress() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare(
      "SELECT stage, unit, done, total, stage_started_s, updated_s, memory_bytes, disk_bytes, "
      "last_error FROM progress");
  if (!query.step()) return std::nullopt;
  return ProgressSnapshot{query.text(0), query.text(1), query.word(2), query.word(3), query.real(4),
                          query.real(5), query.word(6), query.word(7), query.text(8)};
}

}  // namespace voxdag
