// From a scene to planned subvolumes, before any of them is built: what `build` and `plan` share.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/memory_budget.h"
#include "scheduler/build_spec.h"
#include "scheduler/ingest.h"
#include "scheduler/stage_clock.h"
#include "scheduler/top_tree.h"
#include "scheduler/triangle_bins.h"

namespace voxdag {

// A spec with its defaults filled in. Throws Error{kInvalidInput} (or kDevice for a backend that is
// not there) naming the option that is wrong.
BuildSpec checked(const BuildSpec& spec);

struct PreparedScene {
  Grid grid;
  IngestCounts counts;
  uint64_t dropped_invalid = 0;
  std::unique_ptr<MemoryBudget> bins_share;
  std::unique_ptr<TriangleBins> bins;
  BinId whole = 0;  // the bin that holds all triangles
  std::vector<SubvolumePlan> plan;
};

// Scans and ingests the scene of a checked spec and plans its subvolumes. Triangles that do not fit
// a third of the budget go to `spill_path`.
PreparedScene prepare_scene(const BuildSpec& spec, const std::string& spill_path,
                            MemoryBudget& budget, StageClock& clock, const Seams& seams);

}  // namespace voxdag
