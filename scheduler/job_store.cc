#include "scheduler/job_store.h"

#include "core/base/error.h"
#include "core/format/checksum.h"

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
  segment INTEGER NOT NULL, offset INTEGER NOT NULL, bytes INTEGER NOT NULL,
  index_offset INTEGER NOT NULL, checksum INTEGER NOT NULL,
  voxels INTEGER NOT NULL, svo_nodes INTEGER NOT NULL, dag_nodes INTEGER NOT NULL,
  root_hash INTEGER NOT NULL,
  row_checksum INTEGER NOT NULL
);
-- Replacing a row looks for rows that refer to it: without an index, through all of them.
CREATE INDEX subvolume_by_parent ON subvolume (parent);
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

// SQLite does not check its pages: what decides the result is checked row by row.
uint64_t row_checksum(const StoredSubvolume& s) {
  const ArtifactRef& a = s.artifact;
  const uint64_t words[] = {static_cast<uint64_t>(s.id),
                            s.cube.level,
                            s.cube.position[0],
                            s.cube.position[1],
                            s.cube.position[2],
                            static_cast<uint64_t>(s.state),
                            a.segment,
                            a.offset,
                            a.bytes,
                            a.index_offset,
                            a.checksum,
                            s.summary.voxels,
                            s.summary.svo_nodes,
                            s.summary.dag_nodes,
                            s.summary.root_hash};
  return checksum64(std::as_bytes(std::span(words)));
}

// The one way a subvolume's row is written.
void write_row(SqlDatabase& database, const StoredSubvolume& s, std::optional<SubvolumeId> parent) {
  auto insert = database.prepare(
      "INSERT OR REPLACE INTO subvolume VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, "
      "?)");
  insert.bind(0, s.id);
  if (parent) insert.bind(1, *parent);
  insert.bind(2, int64_t{s.cube.level});
  for (int a = 0; a < 3; ++a) insert.bind(3 + a, int64_t{s.cube.position[a]});
  insert.bind(6, s.weight).bind(7, static_cast<int64_t>(s.state));
  insert.bind(8, int64_t{s.artifact.segment}).bind_word(9, s.artifact.offset);
  insert.bind_word(10, s.artifact.bytes).bind_word(11, s.artifact.index_offset);
  insert.bind_word(12, s.artifact.checksum).bind_word(13, s.summary.voxels);
  insert.bind_word(14, s.summary.svo_nodes).bind_word(15, s.summary.dag_nodes);
  insert.bind_word(16, s.summary.root_hash).bind_word(17, row_checksum(s));
  insert.run();
}

StoredSubvolume read_row(const SqlStatement& row) {
  StoredSubvolume s;
  s.id = row.integer(0);
  s.cube.level = static_cast<uint32_t>(row.integer(2));
  for (int a = 0; a < 3; ++a) s.cube.position[a] = static_cast<uint32_t>(row.integer(3 + a));
  s.weight = row.real(6);
  s.state = static_cast<SubvolumeState>(row.integer(7));
  s.artifact = {static_cast<uint32_t>(row.integer(8)), row.word(9), row.word(10), row.word(11),
                row.word(12)};
  s.summary = {row.word(13), row.word(14), row.word(15), row.word(16)};
  if (row.word(17) != row_checksum(s))
    throw Error(ErrorCode::kCorrupt, "job store: the row of subvolume " + std::to_string(s.id) +
                                         " fails its checksum: start over with --restart");
  return s;
}

}  // namespace

JobStore::JobStore(const std::string& path, Access access)
    : database_(path, access == Access::kBuild ? SqlDatabase::Mode::kReadWrite
                                               : SqlDatabase::Mode::kReadOnly) {
  const int64_t application = database_.integer("PRAGMA application_id");
  const int64_t version = database_.integer("PRAGMA user_version");
  const bool fresh = application == 0 && version == 0 &&
                     database_.integer("SELECT count(*) FROM sqlite_master") == 0;
  if (access == Access::kBuild && (fresh || application == kApplicationId)) {
    database_.execute("PRAGMA journal_mode = WAL");
    database_.execute("PRAGMA foreign_keys = ON");
  }
  if (fresh && access == Access::kBuild) {
    SqlTransaction transaction(database_);
    database_.execute(kSchema);
    database_.execute("PRAGMA application_id = " + std::to_string(kApplicationId));
    database_.execute("PRAGMA user_version = " + std::to_string(kSchemaVersion));
    transaction.commit();
    return;
  }
  if (access == Access::kBuild) {
    auto check = database_.prepare("PRAGMA quick_check(1)");
    if (!check.step() || check.text(0) != "ok")
      throw Error(ErrorCode::kCorrupt,
                  path + " is damaged (" + check.text(0) + "): remove it to start over");
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
  database_.execute("DELETE FROM job; DELETE FROM progress;");
  database_.prepare("INSERT INTO job VALUES (1, ?, ?, ?)")
      .bind(0, job.scene_sha256)
      .bind(1, job.geometry)
      .bind(2, job.format_version)
      .run();
  SubvolumeId next = 1;
  for (StoredSubvolume subvolume : plan) {
    subvolume.id = next++;
    write_row(database_, subvolume, std::nullopt);
  }
  transaction.commit();
}

std::vector<StoredSubvolume> JobStore::leaves() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare("SELECT * FROM subvolume ORDER BY id");
  std::vector<StoredSubvolume> leaves;
  while (query.step()) {
    const StoredSubvolume subvolume = read_row(query);
    if (subvolume.state != SubvolumeState::kSplit) leaves.push_back(subvolume);
  }
  return leaves;
}

void JobStore::record_built(std::span<const StoredSubvolume> built) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  for (StoredSubvolume subvolume : built) {
    subvolume.state = SubvolumeState::kBuilt;
    update_row(subvolume);
  }
  transaction.commit();
}

std::vector<SubvolumeId> JobStore::record_split(const StoredSubvolume& whole,
                                                std::span<const Cube> parts) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_, Durable::kLater);
  StoredSubvolume split = whole;
  split.state = SubvolumeState::kSplit;
  update_row(split);
  SubvolumeId next = database_.integer("SELECT max(id) FROM subvolume") + 1;
  std::vector<SubvolumeId> ids;
  for (const Cube& cube : parts) {
    StoredSubvolume part;
    part.id = next++;
    part.cube = cube;
    part.weight = whole.weight / static_cast<double>(parts.size());
    write_row(database_, part, whole.id);
    ids.push_back(part.id);
  }
  transaction.commit();
  return ids;
}

void JobStore::record_lost(const StoredSubvolume& lost) {
  std::lock_guard lock(mutex_);
  StoredSubvolume planned;
  planned.id = lost.id;
  planned.cube = lost.cube;
  planned.weight = lost.weight;
  SqlTransaction transaction(database_);
  update_row(planned);
  transaction.commit();
}

void JobStore::update_row(const StoredSubvolume& subvolume) {
  auto query = database_.prepare("SELECT parent FROM subvolume WHERE id = ? AND parent NOT NULL");
  query.bind(0, subvolume.id);
  const bool has_parent = query.step();
  write_row(database_, subvolume, has_parent ? std::optional(query.integer(0)) : std::nullopt);
}

void JobStore::add_stage_time(const StageTime& time) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_, Durable::kLater);
  database_.prepare("INSERT INTO stage_time (name, wall_s, cpu_s) VALUES (?, ?, ?)")
      .bind(0, time.name)
      .bind(1, time.wall_s)
      .bind(2, time.cpu_s)
      .run();
  transaction.commit();
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
  SqlTransaction transaction(database_, Durable::kLater);
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
  transaction.commit();
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
