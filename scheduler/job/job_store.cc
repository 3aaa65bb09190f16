#include "scheduler/job/job_store.h"

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "scheduler/job/job_schema.h"

namespace voxdag {
namespace {

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
  if (access == Access::kBuild)
    prepare_schema(database_, path);
  else
    check_schema(database_, path);
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
  database_.execute(
      "DELETE FROM job; DELETE FROM progress; DELETE FROM merge; DELETE FROM result;");
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
  announced_.clear();
}

std::vector<StoredSubvolume> JobStore::leaves() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare("SELECT * FROM subvolume ORDER BY id");
  std::vector<StoredSubvolume> leaves;
  while (query.step()) {
    const StoredSubvolume subvolume = read_row(query);
    if (subvolume.state == SubvolumeState::kSplit) continue;
    const auto announced = announced_.find(subvolume.id);
    leaves.push_back(announced == announced_.end() ? subvolume : announced->second);
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
  for (const StoredSubvolume& subvolume : built) announced_.erase(subvolume.id);
}

void JobStore::announce_built(std::span<const StoredSubvolume> built) {
  std::lock_guard lock(mutex_);
  for (const StoredSubvolume& subvolume : built)
    announced_.insert_or_assign(subvolume.id, subvolume).first->second.state =
        SubvolumeState::kBuilt;
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
  database_.execute("DELETE FROM ingest");
  transaction.commit();
  announced_.erase(lost.id);
}

void JobStore::update_row(const StoredSubvolume& subvolume) {
  auto query = database_.prepare("SELECT parent FROM subvolume WHERE id = ? AND parent NOT NULL");
  query.bind(0, subvolume.id);
  const bool has_parent = query.step();
  write_row(database_, subvolume, has_parent ? std::optional(query.integer(0)) : std::nullopt);
}

std::optional<std::vector<std::byte>> JobStore::ingest() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare("SELECT record, row_checksum FROM ingest");
  if (!query.step()) return std::nullopt;
  std::vector<std::byte> record = query.bytes(0);
  if (checksum64(record) != query.word(1))
    throw Error(ErrorCode::kCorrupt, "job store: the row of what was ingested fails its checksum");
  return record;
}

void JobStore::save_ingest(std::span<const std::byte> record) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.prepare("INSERT OR REPLACE INTO ingest VALUES (1, ?, ?)")
      .bind(0, record)
      .bind_word(1, checksum64(record))
      .run();
  transaction.commit();
}

void JobStore::forget_ingest() {
  std::lock_guard lock(mutex_);
  if (database_.integer("SELECT count(*) FROM ingest") == 0) return;
  SqlTransaction transaction(database_);
  database_.execute("DELETE FROM ingest");
  transaction.commit();
}

std::optional<StoredMerge> JobStore::merge() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare("SELECT level, state FROM merge");
  if (!query.step()) return std::nullopt;
  return StoredMerge{static_cast<uint32_t>(query.integer(0)), query.bytes(1)};
}

void JobStore::save_merge(uint32_t level, std::span<const std::byte> state) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.prepare("INSERT OR REPLACE INTO merge VALUES (1, ?, ?)")
      .bind(0, int64_t{level})
      .bind(1, state)
      .run();
  transaction.commit();
}

void JobStore::forget_merge() {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.execute("DELETE FROM merge; DELETE FROM result;");
  transaction.commit();
}

void JobStore::record_result(const JobResult& result) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.prepare("INSERT OR REPLACE INTO result VALUES (1, ?, ?, ?, ?, ?, ?, ?, ?, ?)")
      .bind(0, result.output)
      .bind(1, result.sha256)
      .bind_word(2, result.bytes)
      .bind_word(3, result.voxels)
      .bind_word(4, result.svo_nodes)
      .bind_word(5, result.dag_nodes)
      .bind(6, int64_t{result.merge_rounds})
      .bind_word(7, result.merge_ranges)
      .bind_word(8, result.merge_streamed_groups)
      .run();
  transaction.commit();
}

std::optional<JobResult> JobStore::result() {
  std::lock_guard lock(mutex_);
  auto query = database_.prepare(
      "SELECT output, sha256, bytes, voxels, svo_nodes, dag_nodes, merge_rounds, merge_ranges, "
      "merge_streamed_groups FROM result");
  if (!query.step()) return std::nullopt;
  return JobResult{query.text(0),
                   query.text(1),
                   query.word(2),
                   query.word(3),
                   query.word(4),
                   query.word(5),
                   static_cast<uint32_t>(query.integer(6)),
                   query.word(7),
                   query.word(8)};
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
