// Estimates the resources of a build: pilot builds of the same scene at coarser
// resolutions, extrapolated to the requested one.
//
// Voxels and octree nodes grow as a R^2 + b R (surfaces and their borders): two pilots give a and
// b. DAG nodes grow by a factor per doubling of R: two pilots give the first, and how it falls from
// there as surfaces flatten under the voxel is measured on real scenes. The spread widens with the
// distance.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/ingest/ingest_stage.h"
#include "scheduler/stages/plan/color_estimate.h"
#include "scheduler/stages/plan/estimate_range.h"

namespace voxdag {

struct Estimate {
  uint64_t triangles = 0;
  uint64_t subvolumes = 0;
  double expected_bricks = 0;  // of all triangles, each its own
  uint64_t pilot_resolution = 0;
  EstimateRange voxels, svo_nodes, dag_nodes;
  EstimateRange file_bytes;    // of the global file
  EstimateRange disk_bytes;    // peak: spilled triangles, artifacts and the file
  EstimateRange memory_bytes;  // peak resident memory within the budget
  EstimateRange cpu_s;
  EstimateRange wall_s;
  std::optional<ColorEstimate> colors;  // of a build with colors; included above
  uint64_t free_disk = 0;               // on the disk of the work folder; 0 if unknown
  uint64_t free_memory = 0;             // the budget
};

// Estimates the build of a prepared scene without changing it. The pilots have at
// most 2^pilot_levels voxels per edge: the finer, the better the estimate and the longer it takes.
// The pilots run on this thread, within the budget.
Estimate estimate_build(const GeometryOptions& options, const PreparedScene& scene,
                        BuildScene& source, uint32_t pilot_levels, const StageContext& context);

// Checks before a build that the disk has space for it. Throws Error{kNoSpace} if it
// cannot fit, unless it is forced; warns if it may not. Returns whether that took an estimate,
// which runs a pilot build.
bool check_disk_space(const BuildSpec& spec, const PreparedScene& scene, BuildScene& source,
                      const std::string& work_folder, MemoryBudget& budget,
                      const BuildContext& context);

// One JSON object, names as in docs/cli.md.
std::string estimate_json(const Estimate& estimate);

}  // namespace voxdag
