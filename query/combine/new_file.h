// Writes the file that combine(), cut() and query/morphology compute: its levels, its attributes,
// and finally the complete file.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/format/global/global_writer.h"
#include "core/io/outputs/temporary_work.h"
#include "query/combine/combine.h"
#include "query/combine/join.h"
#include "query/combine/pair_levels.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

// A temporary folder next to the output, a memory budget, and the budget's shares.
struct Workspace {
  Workspace(const CombineSpec& combine_spec, FileSystem& file_system);
  uint64_t share(uint64_t divisor) const {
    return std::min(spec.memory_bytes / divisor, spec.list_bytes);
  }
  // True if the lists of hashes of so many nodes can be in memory.
  bool has_room_for_hashes(uint64_t nodes) const;

  const CombineSpec& spec;
  FileSystem& files;
  MemoryBudget budget;
  const TemporaryWork folder;
  ScratchFolder scratch;
  const SpillSpace space;
  const LookupMemory memory;
};

// The data from which write_levels() makes a new file. `joined` has the results of Join (join.h),
// and `pairs` has the pairs and kept nodes (pair_levels.h); both have one element per level, and
// index 0 is the root's level. `bricks` has the results of the pairs of bricks. `reference` is the
// reference file (reference_of() in operation.h).
struct NewLevels {
  explicit NewLevels(const SpillSpace& space) : bricks(space) {}
  std::vector<std::unique_ptr<JoinedLevel>> joined;
  std::vector<std::unique_ptr<PairLevel>> pairs;
  BrickResults bricks;
  Outcome reference = Outcome::kEmpty;
};

struct NewCounts {
  VoxelCounts octree;
  uint64_t dag_nodes = 0;
};

// Writes the levels of a new file from `levels`, from the bricks up. Returns the numbers of voxels
// and nodes. The new file has the resolution of `a`.
NewCounts write_levels(DagInput& a, DagInput& b, NewLevels& levels, const Workspace& work,
                       GlobalFileWriter& out, Progress& progress);

class NewFile {
 public:
  // Writes the levels, and returns a report with the numbers of voxels, nodes and pairs.
  using WriteVoxels = std::function<CombineReport(GlobalFileWriter& out)>;
  // Writes the attributes to `out`. `result` has the levels of the new file.
  using WriteAttributes =
      std::function<void(const voxdag_reader::File& result, GlobalFileWriter& out)>;

  // The new file has the grid of `grid`, and its path is work.spec.output.
  NewFile(const voxdag_reader::File& grid, Workspace& work, Progress& progress,
          const CancelToken& cancel)
      : grid_(grid), work_(work), progress_(progress), cancel_(cancel) {}

  // Writes the file. `write_attributes` may be empty. Calls before_publish() just before the output
  // gets its final name. If before_publish() throws, the output is discarded.
  CombineReport write(const WriteVoxels& write_voxels, const WriteAttributes& write_attributes,
                      const std::function<void()>& before_publish);

 private:
  GlobalFileWriter writer(const std::string& path) const;
  CombineReport write_all(GlobalFileWriter& out, const WriteVoxels& write_voxels,
                          const WriteAttributes& write_attributes);
  void finish(GlobalFileWriter& out, const VoxelCounts& counts,
              const std::function<void()>& before_publish, CombineReport& report);

  const voxdag_reader::File& grid_;
  Workspace& work_;
  Progress& progress_;
  const CancelToken& cancel_;
};

}  // namespace voxdag::query
