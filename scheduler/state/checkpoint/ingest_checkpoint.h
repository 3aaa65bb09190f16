// Checkpoints of scan, ingest and partition of a large scene. About every two seconds the progress
// becomes durable, in the file of a DurableStore and a row of the job store that refers to it. The
// next run resumes there. The checkpoint also chooses the build's triangle store.
//
// Invariants:
//   1. The row refers to no bytes of the file that were not synced before.
//   2. A row is valid only for the same request, and if every file of the scene is unchanged: same
//      inode, size and times. The times must have been old enough when the file was opened that any
//      later change shows in them.
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
  // Without a job store there are no checkpoints, and no triangles outlive the process.
  IngestCheckpoint(const BuildSpec& spec, JobStore* jobs, WorkFolder& work,
                   const BuildContext& context);

  // The state of an earlier run with this scene, if there is one; enables checkpoints then.
  std::optional<IngestState> resume();
  // True if the scene is large enough for checkpoints and the disk has space for its triangles.
  bool is_worthwhile(const TriangleSource& scene) const;
  // Throws Error{kNoSpace} if the scene's triangles fit neither memory nor disk, unless forced: it
  // may have billions of them in a few bytes.
  void check_disk_space(const TriangleSource& scene) const;
  // Enables checkpoints for a scene opened at that Unix time, and removes checkpoints of other
  // scenes. Does nothing if a later change of a file might not show in its times.
  void enable(const TriangleSource& scene, int64_t opened_ns);
  // True if checkpoints are enabled for a scene of exactly these files.
  bool matches(const std::vector<SourceFile>& files) const;

  // Opens the store for the triangles: as it was at the state's checkpoint if checkpoints are
  // enabled, else an empty one in memory. Memory is charged to `share`. The store must live until
  // the last save().
  std::unique_ptr<TriangleStore> open_store(const IngestState& state, MemoryBudget& share);
  // True if the state's checkpoint stored cells of the top tree; load_top_tree() reads them.
  bool has_top_tree(const IngestState& state) const;
  void load_top_tree(const IngestState& state, std::span<std::byte> cells) const;

  // True if a checkpoint is due and the last one is durable.
  bool is_due();
  // Makes the triangles in the store durable, and then that they are as `state` says, along with
  // `top` if given; sets the extents in `state`. Does nothing where checkpoints are not enabled,
  // and disables them if a file of the scene has changed.
  void save(IngestState& state, std::optional<TopTreeCells> top = {});
  // Saves on another thread, so that ingest does not wait for the disk. The next call throws the
  // thread's error.
  void save_in_background(IngestState& state, std::optional<TopTreeCells> top = {});
  // All subvolumes are built and recorded: removes the triangles. What remains is the record that
  // lets a later run know the scene without reading it.
  void finish();

  // True if the job store has a checkpoint of any scene.
  bool has_saved();
  // Removes all checkpoints, and disables them until the next enable().
  void forget();
  // The same for the rest of this run.
  void disable();
  // True if checkpoints are enabled for triangles that would also fit in memory.
  bool is_optional();

 private:
  // Waits for save_in_background(), and throws what went wrong there.
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
  DurableStore* store_ = nullptr;       // the open one, if it is durable
  std::optional<IngestRecord> record_;  // as last saved; none while checkpoints are not enabled
  double last_save_s_ = 0;
  std::future<void> pending_;  // while valid, record_ belongs to its thread
};

// Bytes of disk that the durable triangles of a scene take at most, reached at the end of the
// partition; 0 if the scene is too small for checkpoints.
double max_durable_bytes(const BuildSpec& spec, uint64_t triangles);
// The Unix time from which on a change of these files shows in their identities; INT64_MAX if one
// of them is not known.
int64_t trusted_from_ns(const std::vector<SourceFile>& files);

}  // namespace voxdag
