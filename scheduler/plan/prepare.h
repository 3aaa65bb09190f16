// From a scene to planned subvolumes, before any of them is built: what `build` and `plan` share.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/stage_clock.h"
#include "scheduler/build_spec.h"
#include "scheduler/ingest/ingest_checkpoint.h"
#include "scheduler/plan/top_tree.h"
#include "scheduler/triangles/triangle_bins.h"

namespace voxdag {

// A spec with its defaults filled in. Throws Error{kInvalidInput} (or kDevice for a backend that is
// not there) naming the option that is wrong.
BuildSpec checked(const BuildSpec& spec);

// The kept bin of a subvolume's triangles.
struct KeptBin {
  Cube cube;
  BinId bin = 0;
};

struct PreparedScene {
  Grid grid;
  IngestCounts counts;
  std::string sha256;  // of the grid and the snapped triangles: names the content
  std::unique_ptr<MemoryBudget> bins_share;
  std::unique_ptr<TriangleBins> bins;
  BinId whole = 0;                  // the bin that holds all triangles, until they are handed down
  std::vector<SubvolumePlan> plan;  // of those that are not handed down
  double max_kept_bytes = 0;        // on the disk, in a build
  // What is kept, if anything.
  IngestState state;
  std::vector<KeptBin> kept_bins;
};

// Scans and ingests the scene of a checked spec and plans its subvolumes. Triangles that do not fit
// their share of the budget go to `spill_path`. With a keeper, goes on where an earlier run left
// off; the scene is not opened if that was past ingest. Throws DamagedTriangles if what it left is.
PreparedScene prepare_scene(const BuildSpec& spec, const std::string& spill_path,
                            MemoryBudget& budget, StageClock& clock, const BuildContext& context,
                            IngestCheckpoint* keeper = nullptr);

}  // namespace voxdag
