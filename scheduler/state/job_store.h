// The durable state of a build in one SQLite file of the work folder (WAL, synchronous = FULL for
// results, foreign_keys = ON): the progress of ingest, the job, its subvolumes and their artifacts,
// the unfinished merge, timings and progress.
//
// Invariants:
//   1. A row names an artifact only after the artifact's bytes were synced.
//   2. Subvolumes form a forest. The children of a split subvolume are its octants that contain
//      triangles or, in a solid, full octants. Only leaves are built.
//   3. Every row that determines the result has a checksum; a mismatch is Error{kCorrupt}.
//      The ids of n subvolumes are 1 to n, and the job's row has n, so a missing row is also
//      Error{kCorrupt}.
//   4. All rows of one call are committed together or not at all.
//
// Thread-safe. The work folder's lock ensures that only one process writes. Readers (`voxdag
// status`) may open the same file at any time. A short build never creates the file: its rows are
// in memory (kBuildLater) until a row must survive the process. A subvolume can be built before its
// row durably records this. Until then, only leaves() of the writer's object returns it as built.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/warning.h"
#include "core/dag/sub_dag.h"
#include "core/db/sqlite.h"
#include "core/format/artifact/artifact.h"
#include "core/geometry/cube.h"
#include "merge/merge.h"
#include "scheduler/spec/stage_clock.h"

namespace voxdag {

// Properties of a job. A build resumes a stored job only if all of them are equal.
struct JobIdentity {
  std::string scene_digest;  // digest of the grid and the snapped triangles
  std::string geometry;      // geometry options as JSON (geometry_json())
  int64_t format_version = 0;
  bool operator==(const JobIdentity&) const = default;
};

enum class SubvolumeState { kPlanned = 0, kBuilt = 1, kSplit = 2 };

using SubvolumeId = int64_t;

struct StoredSubvolume {
  SubvolumeId id = 0;
  Cube cube;
  double weight = 0;
  SubvolumeState state = SubvolumeState::kPlanned;
  // The artifact of a built subvolume; none if `summary` is empty.
  ArtifactRef artifact;
  SubDagSummary summary;
};

// An unfinished merge, as Checkpoint (merge/types/checkpoint.h) describes it.
struct StoredMerge {
  uint32_t level = 0;  // the merge still reads the artifact levels with smaller numbers
  std::vector<std::byte> state;
};

// A complete global file that is about to be renamed to its final name.
struct JobResult {
  std::string output;
  std::string sha256;
  uint64_t bytes = 0;
  MergeReport merge;     // all fields except input_nodes and scratch_bytes
  std::string sections;  // digest of the sections after the levels; "" if none exist
};

// The progress of a build as other processes see it.
struct ProgressSnapshot {
  std::string stage;
  std::string unit;
  uint64_t done = 0;
  uint64_t total = 0;
  uint64_t resumed_at = 0;     // units completed by earlier runs
  double stage_started_s = 0;  // Unix time
  double updated_s = 0;
  uint64_t memory_bytes = 0;  // resident memory
  uint64_t disk_bytes = 0;    // bytes of all files in the work folder
  std::string last_error;
};

class JobStore {
 public:
  // kBuildLater is kBuild, but does not create a file yet if none exists at the path. Then the
  // store is in memory until move_to_disk().
  enum class Access { kBuild, kBuildLater, kRead };

  // Opens the store; kBuild also creates it. Throws Error{kCorrupt} for a damaged store,
  // Error{kInvalidInput} for another kind of database, and Error{kUnsupportedVersion} for a store
  // of another version.
  //
  // `sync_folder` makes the names of the folder and of its files durable. The store calls it before
  // it makes its first row durable. The function must not call this object.
  JobStore(
      const std::string& path, Access access, std::function<void()> sync_folder = [] {});

  // True if a kBuildLater store has no file yet. Then all its rows are lost if the process ends.
  bool is_in_memory() const { return is_in_memory_; }
  // Copies a store in memory to a new file, durably, and uses the file from then on. Does nothing
  // if the store already has a file. These functions call it, because they record work that a later
  // run must not repeat, or that other processes show: record_built(), save_ingest(), save_merge()
  // and set_progress().
  void move_to_disk();

  std::optional<JobIdentity> job();
  // Replaces the job, its subvolumes, progress, merge and result by a new job whose subvolumes are
  // all planned. Keeps the progress of ingest and the stage times.
  void start(const JobIdentity& job, std::span<const StoredSubvolume> plan);
  // Returns the subvolumes that are not split, in the order of their ids.
  std::vector<StoredSubvolume> leaves();
  void record_built(std::span<const StoredSubvolume> built);
  // Makes leaves() of this object return these subvolumes as built. They become durable only with
  // record_built().
  void mark_built_in_memory(std::span<const StoredSubvolume> built);
  // Makes leaves() return unrecorded subvolumes as planned again.
  void forget_built_in_memory();
  // Replaces a subvolume by planned parts. Returns their ids, in the order of `parts`.
  std::vector<SubvolumeId> record_split(const StoredSubvolume& whole, std::span<const Cube> parts);
  // Plans a subvolume with a damaged artifact again. Also removes the progress of ingest, because
  // the triangles of built subvolumes were released.
  void mark_for_rebuild(const StoredSubvolume& lost);

  // Returns the progress of scan, ingest and partition that save_ingest() stored. It belongs to the
  // stored job, or to a job that has not been started yet. Throws Error{kCorrupt} if the progress
  // does not match its checksum.
  std::optional<std::vector<std::byte>> ingest();
  void save_ingest(std::span<const std::byte> record);
  // Removes the progress of ingest, and the warnings. Does not write if the store has neither.
  void forget_ingest();

  // Stores a warning about the scene. Replaces a warning with the same code and message, because a
  // resumed build repeats warnings.
  void add_warning(const Warning& warning);
  std::vector<Warning> warnings();

  std::optional<StoredMerge> merge();
  void save_merge(uint32_t level, std::span<const std::byte> state);
  // Removes the state of the merge and the result that record_result() stored.
  void forget_merge();
  void record_result(const JobResult& result);
  std::optional<JobResult> result();

  void add_stage_time(const StageTime& time);
  std::vector<StageTime> stage_times();
  void set_progress(const ProgressSnapshot& progress);
  std::optional<ProgressSnapshot> progress();

 private:
  void update_row(const StoredSubvolume& subvolume);
  void write_file();

  const std::string path_;
  const std::function<void()> sync_folder_;
  std::atomic<bool> is_in_memory_;
  std::mutex mutex_;  // guards all members below
  SqlDatabase database_;
  std::map<SubvolumeId, StoredSubvolume> built_in_memory_;  // not yet recorded
};

}  // namespace voxdag
