#include "scheduler/state/job_store.h"

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/db/table_rows.h"
#include "core/format/artifact/artifact_fields.h"
#include "core/format/checksum.h"
#include "core/io/file_system.h"
#include "scheduler/spec/report_fields.h"
#include "scheduler/state/job_schema.h"

namespace voxdag {
namespace {

// SQLite has no page checksums. So every row that determines the result has a checksum. The job's
// row also has the number of subvolumes, which shows if a subvolume is missing. Rows of other kinds
// can be missing; their contents are computed again.
template <class Record>
struct Sealed {
  Record record;
  uint64_t checksum = 0;
};

// Collects the bytes of the columns of a row, each after its length, and returns their checksum.
class RowDigest {
 public:
  void fixed(const char*, int64_t) {}
  template <class Value>
  void operator()(const char*, const Value& value) {
    const auto word = static_cast<int64_t>(value);
    add(&word, sizeof word);
  }
  void operator()(const char*, const double& value) { add(&value, sizeof value); }
  void operator()(const char*, const std::string& text) { add(text.data(), text.size()); }
  void operator()(const char*, const std::vector<std::byte>& blob) {
    add(blob.data(), blob.size());
  }
  void operator()(const char*, const std::optional<int64_t>& value) {
    add(value ? &*value : nullptr, value ? sizeof *value : 0);
  }
  uint64_t value() const { return checksum64(std::as_bytes(std::span(bytes_))); }

 private:
  void add(const void* data, uint64_t size) {
    bytes_.append(reinterpret_cast<const char*>(&size), sizeof size);
    bytes_.append(static_cast<const char*>(data), size);
  }
  std::string bytes_;
};

struct SubvolumeRow {
  StoredSubvolume subvolume;
  std::optional<SubvolumeId> parent;
};

template <class Row>
void fields(Row& row, SubvolumeRow& r) {
  StoredSubvolume& s = r.subvolume;
  row("id", s.id);
  row("parent", r.parent);
  fields(row, s.cube);
  row("weight", s.weight);
  row("state", s.state);
  fields(row, s.artifact);
  fields(row, s.summary);
}

struct IngestRow {
  std::vector<std::byte> record;
};

template <class Row>
void fields(Row& row, IngestRow& r) {
  row.fixed("id", 1);
  row("record", r.record);
}

struct JobRow {
  JobIdentity job;
  int64_t subvolumes = 0;
};

}  // namespace

template <class Row>
void fields(Row& row, JobIdentity& job) {
  row.fixed("id", 1);
  row("scene_digest", job.scene_digest);
  row("geometry", job.geometry);
  row("format_version", job.format_version);
}

template <class Row>
void fields(Row& row, StoredMerge& merge) {
  row.fixed("id", 1);
  row("level", merge.level);
  row("state", merge.state);
}

template <class Row>
void fields(Row& row, JobResult& result) {
  row.fixed("id", 1);
  row("output", result.output);
  row("sha256", result.sha256);
  row("bytes", result.bytes);
  row("voxels", result.merge.voxels);
  row("svo_nodes", result.merge.svo_nodes);
  row("dag_nodes", result.merge.dag_nodes);
  row("merge_passes", result.merge.passes);
  row("merge_partitions", result.merge.hash_partitions);
  row("merge_streamed_groups", result.merge.streamed_groups);
  row("sections", result.sections);
}

template <class Row>
void fields(Row& row, ProgressSnapshot& progress) {
  row.fixed("id", 1);
  row("stage", progress.stage);
  row("unit", progress.unit);
  row("done", progress.done);
  row("total", progress.total);
  row("resumed_at", progress.resumed_at);
  row("stage_started_s", progress.stage_started_s);
  row("updated_s", progress.updated_s);
  row("memory_bytes", progress.memory_bytes);
  row("disk_bytes", progress.disk_bytes);
  row("last_error", progress.last_error);
}

namespace {

template <class Row>
void fields(Row& row, JobRow& r) {
  fields(row, r.job);
  row("subvolumes", r.subvolumes);
}

template <class Row, class Record>
void fields(Row& row, Sealed<Record>& sealed) {
  fields(row, sealed.record);
  row("row_checksum", sealed.checksum);
}

template <class Record>
uint64_t checksum_of(Record& record) {
  RowDigest digest;
  fields(digest, record);
  return digest.value();
}

template <class Record>
void put_sealed(SqlDatabase& database, const std::string& table, Record record) {
  const uint64_t checksum = checksum_of(record);
  put_row(database, table, Sealed<Record>{std::move(record), checksum});
}

// Returns the record of a row. Throws Error{kCorrupt} if the row does not match its checksum;
// `what` names the row in the message.
template <class Record>
Record unsealed(Sealed<Record> sealed, const std::string& what) {
  if (sealed.checksum != checksum_of(sealed.record))
    throw Error(ErrorCode::kCorrupt, "the job store (job.db in the work folder): the row of " +
                                         what + " fails its checksum: start over with " +
                                         option_text("restart"));
  return std::move(sealed.record);
}

template <class Record>
std::optional<Record> find_sealed(SqlDatabase& database, const std::string& table,
                                  const std::string& what) {
  auto row = find_row<Sealed<Record>>(database, table);
  if (!row) return std::nullopt;
  return unsealed(std::move(*row), what);
}

void write_subvolume(SqlDatabase& database, const StoredSubvolume& s,
                     std::optional<SubvolumeId> parent) {
  put_sealed(database, "subvolume", SubvolumeRow{s, parent});
}

}  // namespace

JobStore::JobStore(const std::string& path, Access access, std::function<void()> sync_folder)
    : path_(path),
      sync_folder_(std::move(sync_folder)),
      is_in_memory_(access == Access::kBuildLater && !system_files().exists(path)),
      database_(is_in_memory_
                    ? SqlDatabase::in_memory(path)
                    : SqlDatabase(path, access == Access::kRead ? SqlDatabase::Mode::kReadOnly
                                                                : SqlDatabase::Mode::kReadWrite)) {
  if (access != Access::kRead && !is_in_memory_) sync_folder_();
  try {
    if (access == Access::kRead)
      check_job_schema(database_, path);
    else
      prepare_job_schema(database_, path);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt && error.code() != ErrorCode::kUnsupportedVersion)
      throw;
    throw Error(error.code(), "job store " + path + ": " + error.message() + "; start over with " +
                                  option_text("restart"));
  }
}

void JobStore::move_to_disk() {
  std::lock_guard lock(mutex_);
  write_file();
}

void JobStore::write_file() {
  if (!is_in_memory_) return;
  sync_folder_();
  SqlDatabase file(path_, SqlDatabase::Mode::kReadWrite);
  database_.copy_to(file);
  prepare_job_schema(file, path_);
  database_ = std::move(file);
  is_in_memory_ = false;
}

std::optional<JobIdentity> JobStore::job() {
  std::lock_guard lock(mutex_);
  auto row = find_sealed<JobRow>(database_, "job", "the job");
  if (!row) return std::nullopt;
  return std::move(row->job);
}

void JobStore::start(const JobIdentity& job, std::span<const StoredSubvolume> plan) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_);
  database_.execute("UPDATE subvolume SET parent = NULL; DELETE FROM subvolume;");
  database_.execute(
      "DELETE FROM job; DELETE FROM progress; DELETE FROM merge; DELETE FROM result;");
  put_sealed(database_, "job", JobRow{job, static_cast<int64_t>(plan.size())});
  SubvolumeId next = 1;
  for (StoredSubvolume subvolume : plan) {
    subvolume.id = next++;
    write_subvolume(database_, subvolume, std::nullopt);
  }
  transaction.commit();
  built_in_memory_.clear();
}

std::vector<StoredSubvolume> JobStore::leaves() {
  std::lock_guard lock(mutex_);
  // Both statements see the same state of the database, because the first one remains open.
  auto jobs = select_rows<Sealed<JobRow>>(database_, "job");
  if (!jobs.step()) return {};
  const JobRow job = unsealed(read_row<Sealed<JobRow>>(jobs), "the job");
  auto rows = select_rows<Sealed<SubvolumeRow>>(database_, "subvolume", "ORDER BY id");
  std::vector<StoredSubvolume> leaves;
  int64_t count = 0;
  while (rows.step()) {
    auto row = read_row<Sealed<SubvolumeRow>>(rows);
    const std::string name = "subvolume " + std::to_string(row.record.subvolume.id);
    const StoredSubvolume subvolume = unsealed(std::move(row), name).subvolume;
    if (subvolume.id != count + 1) break;
    ++count;
    if (subvolume.state == SubvolumeState::kSplit) continue;
    const auto built = built_in_memory_.find(subvolume.id);
    leaves.push_back(built == built_in_memory_.end() ? subvolume : built->second);
  }
  if (count != job.subvolumes)
    throw Error(ErrorCode::kCorrupt,
                "the job store (job.db in the work folder): the rows of the subvolumes are "
                "complete only up to " +
                    std::to_string(count) + ": expected " + std::to_string(job.subvolumes) +
                    "; start over with " + option_text("restart"));
  return leaves;
}

void JobStore::record_built(std::span<const StoredSubvolume> built) {
  std::lock_guard lock(mutex_);
  write_file();
  SqlTransaction transaction(database_);
  for (StoredSubvolume subvolume : built) {
    subvolume.state = SubvolumeState::kBuilt;
    update_row(subvolume);
  }
  transaction.commit();
  for (const StoredSubvolume& subvolume : built) built_in_memory_.erase(subvolume.id);
}

void JobStore::mark_built_in_memory(std::span<const StoredSubvolume> built) {
  std::lock_guard lock(mutex_);
  for (const StoredSubvolume& subvolume : built)
    built_in_memory_.insert_or_assign(subvolume.id, subvolume).first->second.state =
        SubvolumeState::kBuilt;
}

void JobStore::forget_built_in_memory() {
  std::lock_guard lock(mutex_);
  built_in_memory_.clear();
}

std::vector<SubvolumeId> JobStore::record_split(const StoredSubvolume& whole,
                                                std::span<const Cube> parts) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_, Durable::kLater);
  StoredSubvolume split = whole;
  split.state = SubvolumeState::kSplit;
  update_row(split);
  auto job = find_sealed<JobRow>(database_, "job", "the job");
  if (!job)
    throw Error(ErrorCode::kCorrupt,
                "the job store (job.db in the work folder): the row of the job is missing: start "
                "over with " +
                    option_text("restart"));
  SubvolumeId next = job->subvolumes + 1;
  job->subvolumes += static_cast<int64_t>(parts.size());
  put_sealed(database_, "job", *job);
  std::vector<SubvolumeId> ids;
  for (const Cube& cube : parts) {
    StoredSubvolume part;
    part.id = next++;
    part.cube = cube;
    part.weight = whole.weight / static_cast<double>(parts.size());
    write_subvolume(database_, part, whole.id);
    ids.push_back(part.id);
  }
  transaction.commit();
  return ids;
}

void JobStore::mark_for_rebuild(const StoredSubvolume& lost) {
  std::lock_guard lock(mutex_);
  StoredSubvolume planned;
  planned.id = lost.id;
  planned.cube = lost.cube;
  planned.weight = lost.weight;
  SqlTransaction transaction(database_);
  update_row(planned);
  database_.execute("DELETE FROM ingest");
  transaction.commit();
  built_in_memory_.erase(lost.id);
}

void JobStore::update_row(const StoredSubvolume& subvolume) {
  auto rows = select_rows<SubvolumeRow>(database_, "subvolume", "WHERE id = ?");
  rows.bind(0, subvolume.id);
  write_subvolume(database_, subvolume,
                  rows.step() ? read_row<SubvolumeRow>(rows).parent : std::nullopt);
}

std::optional<std::vector<std::byte>> JobStore::ingest() {
  std::lock_guard lock(mutex_);
  auto row = find_sealed<IngestRow>(database_, "ingest", "the ingest progress");
  if (!row) return std::nullopt;
  return std::move(row->record);
}

void JobStore::save_ingest(std::span<const std::byte> record) {
  std::lock_guard lock(mutex_);
  write_file();
  SqlTransaction transaction(database_);
  put_sealed(database_, "ingest", IngestRow{{record.begin(), record.end()}});
  transaction.commit();
}

void JobStore::forget_ingest() {
  std::lock_guard lock(mutex_);
  if (database_.integer("SELECT EXISTS (SELECT 1 FROM ingest UNION SELECT 1 FROM warning)") == 0)
    return;
  SqlTransaction transaction(database_);
  database_.execute("DELETE FROM ingest; DELETE FROM warning;");
  transaction.commit();
}

void JobStore::add_warning(const Warning& warning) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_, Durable::kLater);
  auto replaced = database_.prepare("DELETE FROM warning WHERE code = ? AND message = ?");
  replaced.bind(0, warning.code);
  replaced.bind(1, warning.message);
  replaced.run();
  put_row(database_, "warning", warning);
  transaction.commit();
}

std::vector<Warning> JobStore::warnings() {
  std::lock_guard lock(mutex_);
  auto rows = select_rows<Warning>(database_, "warning", "ORDER BY id");
  std::vector<Warning> warnings;
  while (rows.step()) warnings.push_back(read_row<Warning>(rows));
  return warnings;
}

std::optional<StoredMerge> JobStore::merge() {
  std::lock_guard lock(mutex_);
  return find_sealed<StoredMerge>(database_, "merge", "the merge");
}

void JobStore::save_merge(uint32_t level, std::span<const std::byte> state) {
  std::lock_guard lock(mutex_);
  write_file();
  SqlTransaction transaction(database_);
  put_sealed(database_, "merge", StoredMerge{level, {state.begin(), state.end()}});
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
  put_sealed(database_, "result", result);
  transaction.commit();
}

std::optional<JobResult> JobStore::result() {
  std::lock_guard lock(mutex_);
  return find_sealed<JobResult>(database_, "result", "the result");
}

void JobStore::add_stage_time(const StageTime& time) {
  std::lock_guard lock(mutex_);
  SqlTransaction transaction(database_, Durable::kLater);
  put_row(database_, "stage_time", time);
  transaction.commit();
}

std::vector<StageTime> JobStore::stage_times() {
  std::lock_guard lock(mutex_);
  auto rows = select_rows<StageTime>(database_, "stage_time", "ORDER BY id");
  std::vector<StageTime> times;
  while (rows.step()) times.push_back(read_row<StageTime>(rows));
  return times;
}

void JobStore::set_progress(const ProgressSnapshot& p) {
  std::lock_guard lock(mutex_);
  write_file();
  SqlTransaction transaction(database_, Durable::kLater);
  put_row(database_, "progress", p);
  transaction.commit();
}

std::optional<ProgressSnapshot> JobStore::progress() {
  std::lock_guard lock(mutex_);
  return find_row<ProgressSnapshot>(database_, "progress");
}

}  // namespace voxdag
