// The report of a finished build. A plain value.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/warning.h"
#include "core/geometry/grid.h"
#include "core/geometry/voxel_rule.h"
#include "merge/merge.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/spec/stage_clock.h"
#include "scheduler/spec/stage_totals.h"

namespace voxdag {

// The interior of a solid build.
struct SolidReport {
  std::string rule;
  std::optional<std::array<double, 3>> seed;  // the option of the same name
  std::optional<uint32_t> radius;             // the option of the same name, unless it is 0
  uint64_t interior = 0;                      // set voxels that the surface does not touch
  double volume = 0;                          // volume of all set voxels, in units of the scene
  uint64_t rows = 0;                          // sample rows that cross the surface
  uint64_t open_rows = 0;  // sample rows that enter the solid more or less often than they leave it
  uint64_t odd_rows = 0;   // sample rows with an odd number of crossings
  uint64_t disputed = 0;   // interior voxels whose views disagree (core/geometry/solid_rule.h)
};

struct BuildReport {
  std::string output;
  std::vector<std::string> scenes;  // paths relative to the folder of `output`
  std::string sha256;
  Grid grid;
  uint32_t hash_bits = 64;
  VoxelRule rule = VoxelRule::kShell;
  OrderName node_order = OrderName::kHash;
  uint64_t bytes = 0;
  MergeReport merge;
  uint64_t triangles = 0;  // triangles whose bounding boxes touch the grid
  uint64_t dropped_outside = 0;
  uint64_t dropped_invalid = 0;
  uint64_t subvolumes = 0;  // all subvolumes, including empty and reused ones
  uint64_t subvolumes_split = 0;
  uint64_t subvolumes_reused = 0;  // taken from an earlier run of this job, or from the cache
  uint64_t subvolumes_cached = 0;  // reused subvolumes that came from the cache
  uint64_t artifact_bytes = 0;
  uint64_t artifact_nodes = 0;
  uint64_t spill_bytes = 0;
  uint64_t memory_bytes = 0;
  unsigned threads = 0;
  std::string backend;  // backend that built the subvolumes of this run
  std::vector<StageTime> stages;
  double wall_s = 0;
  double cpu_s = 0;
  uint64_t peak_rss_bytes = 0;
  std::optional<SolidReport> solid;      // only for a solid build
  std::optional<ColorReport> colors;     // only for a build with colors
  std::optional<ClusterTotals> cluster;  // only for a cluster build
  std::vector<Warning> warnings;         // warnings about the scene
  std::string merge_request;  // only if a merge job wrote the output (MergeJob::request())
};

// Default path of the report of a build with this output path.
inline std::string default_report_path(const std::string& output) {
  return output + ".report.json";
}
// Path of the report of a build with these options; "" if it writes none.
inline std::string report_path(const RunOptions& run) {
  if (run.report == "none") return "";
  return run.report.empty() ? default_report_path(run.output) : run.report;
}

// Returns the scene files as reports name them: relative to the output's folder. So the names do
// not depend on the current folder, and remain valid if the folders move together.
std::vector<std::string> reported_scenes(const BuildSpec& spec);

// Returns one JSON object; docs/cli.md lists its members.
std::string report_json(const BuildReport& report);
// Decodes a report. Throws Error{kCorrupt} for a text not created by report_json(). Fields missing
// from the text have their defaults.
BuildReport decode_report(const std::string& text);

}  // namespace voxdag
