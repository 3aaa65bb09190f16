// Lets scan, ingest and hand-down of a large scene survive the process: about every two seconds
// what was done is made durable, in a file of triangles and a row of the job store that says what
// it holds, so that the next run goes on there.
//
// Invariants:
//   1. The row names nothing in the file that was not synced before.
//   2. A row counts only where the same was asked for and every file of the scene is the one that
//      was read, unchanged: same inode, size and times, and those so old when it was opened that
//      any later change shows in them.
//   3. What does not count, or is damaged, is forgotten: the scene is read again.
// Used by one thread.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "scheduler/build_spec.h"
#include "scheduler/ingest/ingest_record.h"
#include "scheduler/job/job_store.h"
#include "scheduler/job/work_folder.h"
#include "scheduler/triangles/triangle_bins.h"

namespace voxdag {

class IngestCheckpoint {
 public:
  IngestCheckpoint(const BuildSpec& spec, JobStore& store, WorkFolder& work,
                   const BuildContext& context);

  // Where an earlier run left off with this scene, if it did. Begins to keep what follows.
  std::optional<IngestState> resume();
  // Whether this scene is worth keeping, and the disk has room for it.
  bool wants(const TriangleSource& scene) const;
  // Begins to keep a scene that was opened at that Unix time; what was kept before is forgotten.
  // Does nothing if a change since then might not show.
  void begin(const TriangleSource& scene, int64_t opened_ns);
  // Whether these are the files that the scene was read from so far.
  bool is_of(const std::vector<SourceFile>& files) const;

  bool keeps() const { return record_.has_value(); }
  std::unique_ptr<TriangleFile> open_file(uint64_t end);
  // Whether it is time for a checkpoint, and the last one is durable.
  bool is_due();
  // Makes durable what is in the kept bins, and that it is as `state` says; completes `state` by
  // where it lies. Does nothing where nothing is kept, and gives up if the scene's files have
  // changed.
  void save(IngestState& state, TriangleBins& bins);
  // The same on another thread, so that the disk does not keep ingest waiting: a crash costs the
  // interval and what a sync takes. What goes wrong is thrown by the next call.
  void save_soon(IngestState& state, TriangleBins& bins);
  // Of a scan, which has no triangles.
  void save_scan(const IngestState& state);
  // All subvolumes are built and recorded: the triangles go, and that the scene is the same is all
  // that stays to be known.
  void finish();

  // Whether there is something to go on with, of whatever scene.
  bool has_saved();
  void forget();
  // Forgets, and keeps nothing for the rest of this run.
  void give_up();
  // Whether the triangles fit in memory as well.
  bool is_optional();

 private:
  // Waits for what save_soon() began.
  void settle();
  void settle_whatever_comes();
  bool files_are_unchanged() const;
  void commit(const IngestState& state);
  void forget_saved();

  const BuildSpec& spec_;
  JobStore& store_;
  WorkFolder& work_;
  const BuildContext& context_;
  std::optional<IngestRecord> record_;  // as last saved
  double begun_s_ = 0;                  // the last checkpoint
  std::future<void> pending_;           // until it is settled, record_ belongs to its thread
  bool gave_up_ = false;
};

// Bytes that the kept triangles of a scene take at most, while they are handed down; 0 if it is too
// small to be kept.
double max_kept_bytes(const BuildSpec& spec, uint64_t triangles);
// The Unix time from which on a change of these files shows in their identities; INT64_MAX if one
// of them is not known.
int64_t settled_ns(const std::vector<SourceFile>& files);
int64_t unix_ns();

}  // namespace voxdag
