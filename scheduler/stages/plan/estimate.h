// Estimates the resources of a build. Builds the scene at two coarser resolutions (the pilots) and
// extrapolates their results to the requested resolution.
//
// The numbers of voxels and octree nodes grow with the resolution R as a R^2 + b R: a R^2 for the
// area of surfaces, b R for the length of their borders. Two pilots give a and b. The number of DAG
// nodes grows by a factor whenever R doubles. Two pilots give the first factor. A surface looks
// flatter within smaller voxels, so the factor falls with each further doubling, at a rate measured
// on real scenes. The range of an estimate widens with the number of doublings from the pilots.
//
// The pilots of a solid are solids. The voxels and octree nodes of a solid grow as a R^3 + b R^2: a
// R^3 for the volume of the interior, b R^2 for the area of surfaces.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/warning.h"
#include "scheduler/solid/solid_rows.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/ingest/ingest_stage.h"
#include "scheduler/stages/plan/color_estimate.h"
#include "scheduler/stages/plan/estimate_range.h"

namespace voxdag {

// The interior of a solid, and the counts of the finer pilot's sample rows.
struct SolidEstimate {
  std::string rule;
  EstimateRange interior;  // voxels of the solid that no triangle touches
  EstimateRange disputed;  // interior voxels whose views disagree (core/geometry/solid_rule.h)
  RowCounts rows;
  std::optional<Warning> warning;  // the warning that the build is expected to give
};

struct Estimate {
  uint64_t triangles = 0;
  uint64_t subvolumes = 0;
  double expected_bricks = 0;     // sum of the expected bricks of each triangle
  uint64_t pilot_resolution = 0;  // 0: no pilot fits in memory, so only the voxels are estimated
  EstimateRange voxels, svo_nodes, dag_nodes;
  EstimateRange file_bytes;    // size of the global file
  EstimateRange disk_bytes;    // peak use, including spilled triangles, artifacts and the file
  EstimateRange memory_bytes;  // peak resident memory within the budget
  EstimateRange cpu_s;
  EstimateRange wall_s;
  std::optional<ColorEstimate>
      colors;                          // only for a build with colors; included in the totals above
  std::optional<SolidEstimate> solid;  // only for a solid whose pilots fit the memory
  uint64_t free_disk = 0;              // free bytes on the work folder's disk; 0 if unknown
  uint64_t free_memory = 0;            // the memory budget in bytes
};

// Estimates the build of a prepared scene without changing it. The pilots run on this thread,
// within the budget.
Estimate estimate_build(const BuildSpec& spec, const PreparedScene& scene, BuildScene& source,
                        const StageContext& context);

// Checks before a build that the disk has space for it, including the decoded images. Throws
// Error{kNoSpace} if the build cannot fit, and warns if it is possible that it does not fit. Does
// nothing if RunOptions::force is set. Returns true if the check required an estimate, which runs
// pilot builds.
bool check_disk_space(const BuildSpec& spec, const PreparedScene& scene, BuildScene& source,
                      const std::string& work_folder, MemoryBudget& budget,
                      const BuildContext& context);

// Returns one JSON object with the names in docs/cli.md.
std::string estimate_json(const Estimate& estimate);

}  // namespace voxdag
