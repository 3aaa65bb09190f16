// The merger's one public function: many sub-DAGs and the top tree above them become one global
// DAG.
//
// Level by level from the bricks up, two streaming steps each (DESIGN: "why the merge is right"):
//   rewire   each run's child indices go through its own old -> new map, which is strictly
//            increasing, so the run stays sorted by (hash, mask, children)
//   sweep    the sorted runs are merged by the full key, equal nodes dropped, maps emitted
// The nodes above the subvolumes (the top tree) are one more run in the sweep of their level. What
// is in memory is bounded by the budget, never by the scene: hash ranges, then rounds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/artifact/artifact.h"
#include "core/format/global/global_writer.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"

namespace voxdag {

struct MergeInputs {
  uint32_t grid_levels = 2;
  uint32_t hash_bits = 64;
  // The subvolumes' artifacts, cubes disjoint, in any order; none for an empty scene.
  std::vector<ArtifactRef> artifacts;
  // Opens the segment file of an id.
  std::function<std::shared_ptr<ReadableFile>(uint32_t)> open_segment;
  // A folder of its own for what does not fit in memory: maps and the artifacts of merge rounds.
  // What it holds at the end is what a checkpoint names.
  std::string scratch_folder;
  // Less work than this, in CPU seconds, is not worth a checkpoint.
  double checkpoint_interval_s = 2;
};

// Where the state of an unfinished merge is kept, so that it can go on there.
//
// A state is some hundred KB that only the merge understands; it names files of the scratch folder
// and the global file's partial one, all synced before save(). It knows the inputs by their
// content, so an artifact that was built again in between does no harm.
class Checkpoint {
 public:
  virtual ~Checkpoint() = default;
  // save() and release() are called by threads beside the merge, one call at a time.

  // The state saved last, if there is one.
  virtual std::optional<std::vector<std::byte>> load() = 0;
  // Replaces it; durable on return. Of the inputs' levels only those above `level` (of smaller
  // number) are read from here on.
  virtual void save(uint32_t level, std::span<const std::byte> state) = 0;
  // It is of no use any more.
  virtual void forget() = 0;
  // Nothing reads these bytes of an input's segment any more: their space may be given back.
  virtual void release(uint32_t segment, uint64_t offset, uint64_t bytes) = 0;
};

struct MergeReport {
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;  // top tree included
  uint64_t dag_nodes = 0;
  uint64_t input_nodes = 0;  // rows of all runs of all rounds
  uint32_t rounds = 0;       // 1 if all runs were swept at once
  uint64_t scratch_bytes = 0;
  uint64_t hash_ranges = 0;      // slabs of the hash space that were swept one after the other
  uint64_t streamed_groups = 0;  // groups of equal hashes too large for memory, swept row by row
};

// Throws Error. `files` is where scratch files go; `out` gets all levels but is not sealed. With a
// checkpoint, goes on from the state that it has; a state that does not fit is forgotten with a
// warning, and the merge starts over.
MergeReport merge_sub_dags(const MergeInputs& inputs, FileSystem& files, GlobalFileWriter& out,
                           MemoryBudget& budget, unsigned threads, Progress& progress,
                           const CancelToken& cancel, Checkpoint* checkpoint = nullptr);

}  // namespace voxdag
