// The public functions of the merge: many sub-DAGs and the top tree above them become one global
// DAG, or one artifact.
//
// Levels are merged from the bricks up. The nodes above the subvolumes (the top tree) are one more
// run of their level. A level is merged hash partition by hash partition (usually one is enough):
//
//   load     the rows of all runs with a hash in the partition are read, and their children are
//            replaced by their positions in the merged level below (rewiring)
//   sort     the rows are divided into buckets by the next bits of the hash; several threads sort
//            one bucket each and deduplicate its rows
//   output   buckets are written in the order of their hashes, and the position of every row is
//            stored for the level above
//
// The order within the runs is used to find the frames of a partition and the rows of a bucket, and
// by the k-way heap merge for rows that a sort cannot hold (truncated hashes). Memory use is
// bounded by the budget, never by the scene: if not all runs fit in one pass, neighboring artifacts
// are first merged with each other, in one or more passes. docs/architecture.md, "Why the merge is
// right", has the proof; merge/load/row.h defines the terms.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact.h"
#include "core/format/artifact/segment_writer.h"
#include "core/format/global/global_writer.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

struct MergeInputs {
  DagShape shape;
  // The artifacts of the subvolumes, in any order; none for an empty scene. Their cubes are
  // disjoint.
  std::vector<ArtifactRef> artifacts;
  // Opens the segment file with an id.
  std::function<std::shared_ptr<ReadableFile>(uint32_t)> open_segment;
  // A folder for data that does not fit in memory, used only by this merge. After the merge it has
  // only the files named by the state in the checkpoint.
  std::string scratch_folder;
  // The least CPU time between two checkpoints, in seconds.
  double checkpoint_interval_s = 2;
};

// Where the state of an unfinished merge is stored, so that it can be resumed.
//
// A state is some hundred KB that only the merge understands. It names files of the scratch folder
// and the partial global file, all of which are synced before save(). It identifies the inputs by
// their content, so it still fits after an artifact was built again. Background threads
// call save() and release(), one after the other.
class Checkpoint {
 public:
  virtual ~Checkpoint() = default;

  // The state saved last, if there is one.
  virtual std::optional<std::vector<std::byte>> load() = 0;
  // Replaces the state; it is durable on return. From here on only the levels of the inputs above
  // `level` (with smaller numbers) are read.
  virtual void save(uint32_t level, std::span<const std::byte> state) = 0;
  // Discards the state.
  virtual void forget() = 0;
  // These bytes of the segment of an input are never read again: their space may be freed.
  virtual void release(const SegmentRange& range) = 0;
};

struct MergeReport {
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;  // top tree included
  uint64_t dag_nodes = 0;
  uint64_t input_nodes = 0;  // rows of all runs of all passes
  uint32_t passes = 0;       // 1 if all runs were merged in one pass
  uint64_t scratch_bytes = 0;
  uint64_t hash_partitions = 0;
  uint64_t streamed_groups = 0;  // groups of equal hashes that did not fit in memory
};

// Scratch files go through `files`; `out` gets all levels but is not sealed. Resumes the state that
// `checkpoint` has; a state that does not fit is discarded with a warning, and the merge starts
// over. Throws Error.
MergeReport merge_sub_dags(const MergeInputs& inputs, FileSystem& files, GlobalFileWriter& out,
                           MemoryBudget& budget, unsigned threads, Progress& progress,
                           const CancelToken& cancel, Checkpoint* checkpoint = nullptr);

// Merges sub-DAGs into one artifact at the end of `out`, which has all their roots: rows that
// several of them have become one, and a later merge has fewer to read. There must be an input.
// Throws Error{kOutOfMemory} if even passes over neighbors do not fit the budget, or the artifact
// would have over 2^32 rows.
ArtifactRef merge_to_artifact(const MergeInputs& inputs, FileSystem& files, SegmentWriter& out,
                              MemoryBudget& budget, unsigned threads, Progress& progress,
                              const CancelToken& cancel, MergeReport& report);

}  // namespace voxdag
