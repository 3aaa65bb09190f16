// Checkpoints of the stages before the build of subvolumes (scan, ingest and partition) of a large
// scene. About every two seconds the progress becomes durable: the triangles in the file of a
// DurableStore, and the state in a row of the job store, which refers to that file. The next run
// resumes at this progress. The checkpoint also chooses the build's triangle store.
//
// Invariants:
//   1. The row refers only to bytes of the file that were synced before the row was written.
//   2. A row is valid only if the request (the geometry options and the paths of the scene) is the
//      same, and if every file that decides the voxels (the scene's files, and the images of
//      cutouts that are left out) has the same inode, size and times. When the scene was opened,
//      the times must have been so old that any later change of a file gives it different times.
//   3. An invalid or damaged row is removed, and the scene is read again.
// Used by one thread.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <span>

#include "scheduler/spec/build_spec.h"
#include "scheduler/state/checkpoint/ingest_record.h"
#include "scheduler/state/job_store.h"
#include "scheduler/state/work_folder.h"
#include "scheduler/triangles/durable_store.h"

namespace voxdag {

// The counters of a top tree and their total weight.
struct TopTreeCells {
  std::span<const std::byte> cells;
  double total_weight = 0;
};

class IngestCheckpoint {
 public:
  // If `jobs` is null, no checkpoints are made, and triangles do not outlive the process.
  IngestCheckpoint(const BuildSpec& spec, JobStore* jobs, WorkFolder& work,
                   const BuildContext& context);

  // Returns the state of an earlier run with this scene and enables checkpoints; nullopt if there
  // is no such state.
  std::optional<IngestState> resume();
  // True if the scene is large enough for checkpoints, and one of two conditions holds. Either the
  // triangles do not fit in memory, so that the disk must hold them anyway. Or the disk has ample
  // space.
  bool is_worthwhile(const TriangleSource& scene) const;
  // Throws Error{kNoSpace} if memory and disk together have no space for the scene's triangles. So
  // a scene of a few bytes that declares billions of triangles is refused. Does nothing if
  // RunOptions::force is set or the options give the bounds.
  void check_disk_space(const TriangleSource& scene) const;
  // Enables checkpoints for a scene that was opened at Unix time `opened_ns`, and removes
  // checkpoints of other scenes. Leaves checkpoints disabled if a later change of a file might not
  // change its times. `files`: all files that decide the voxels.
  void enable(const TriangleSource& scene, std::vector<SourceFile> files, int64_t opened_ns);
  // True if checkpoints are enabled for a scene with exactly these files.
  bool matches(const std::vector<SourceFile>& files) const;

  // Opens the store for the triangles. If checkpoints are enabled, the store has the contents of
  // the state's checkpoint; otherwise it is empty and in memory. Memory is charged to `share`. The
  // store must live until the last save().
  std::unique_ptr<TriangleStore> open_store(const IngestState& state, MemoryBudget& share);
  // True if the state's checkpoint stored cells of the top tree; load_top_tree() reads them.
  bool has_top_tree(const IngestState& state) const;
  void load_top_tree(const IngestState& state, std::span<std::byte> cells) const;

  // True if a checkpoint is due and the last one is durable.
  bool is_due();
  // Makes the triangles in the store and, if given, `top` durable, and sets their extents in
  // `state`. Then writes `state` to its row of the job store. Does nothing if checkpoints are not
  // enabled. If a file of the scene has changed, writes no row and disables checkpoints.
  void save(IngestState& state, std::optional<TopTreeCells> top = {});
  // Saves on another thread, so that ingest does not wait for the disk. The next call throws the
  // thread's error.
  void save_in_background(IngestState& state, std::optional<TopTreeCells> top = {});
  // Called when the durable triangles are not needed any more: all subvolumes are recorded as
  // built, or the batch files of a cluster build contain their triangles. Removes the durable
  // triangles. Keeps the record, so that a later run recognizes the scene without reading it.
  void finish();

  // True if the job store has a checkpoint of any scene.
  bool has_saved();
  // Removes all checkpoints, and disables them until the next enable().
  void forget();
  // Like forget(), and checkpoints remain disabled for the rest of this run.
  void disable();
  // True if checkpoints are enabled for triangles that would also fit in memory.
  bool is_optional();

 private:
  // Waits for save_in_background() and throws its error, if any.
  void wait();
  void wait_ignoring_errors();
  bool files_are_unchanged() const;
  void commit(const IngestState& state);
  void forget_saved();

  const BuildSpec& spec_;
  JobStore* const jobs_;
  WorkFolder& work_;
  const BuildContext& context_;
  bool is_disabled_;
  DurableStore* store_ = nullptr;       // the open store, if it is durable
  std::optional<IngestRecord> record_;  // the last saved record, if checkpoints are enabled
  double last_save_s_ = 0;
  std::future<void> pending_;  // while valid, its thread uses record_
};

// Returns the maximum disk space of a scene's stored triangles, reached at the end of the
// partition. If the scene is large enough for checkpoints, all triangles are on the disk. Otherwise
// only the triangles that do not fit in memory are on the disk. `records`: number of stored
// triangles. It exceeds `triangles` if patches replace triangles that are cut out in part.
double max_disk_bytes(const BuildSpec& spec, uint64_t triangles, uint64_t records);
// Returns the earliest Unix time, in nanoseconds, after which every change of one of these files
// also changes its FileIdentity (core/io/file_system.h). An earlier change can get the same file
// times as the change before it. Returns INT64_MAX if the identity of a file is unknown.
int64_t trusted_from_ns(const std::vector<SourceFile>& files);

}  // namespace voxdag
