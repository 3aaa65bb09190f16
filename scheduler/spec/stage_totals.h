// Totals of some stages in the build report. Plain values.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace voxdag {

// Totals of the tasks of a cluster build.
struct ClusterTotals {
  uint64_t batches = 0;                      // built batches
  uint64_t attempts = 0;                     // failed attempts
  uint64_t split = 0;                        // subvolumes that tasks split
  uint64_t rows_before = 0, rows_after = 0;  // DAG nodes before and after the tasks' merges
  double cpu_s = 0;                          // CPU time of all tasks whose records were accepted
  double longest_s = 0;                      // wall time of the longest of these tasks
  double first_task_s = 0;  // time from the first submission to the first task's start
  uint64_t requests = 0;    // requests to Slurm
  std::map<std::string, uint64_t> batches_of_node;
};

// Totals of the attributes stage.
struct ColorReport {
  uint64_t resolution = 0;               // color grid's resolution; 0 for a file without colors
  uint64_t cells = 0;                    // cells of the color grid that have a color
  uint64_t images = 0, image_bytes = 0;  // decoded images, and bytes of their pyramids
  uint64_t cubes = 0, cubes_reused = 0;  // cubes with surfaces; cubes baked by an earlier run
  uint64_t spill_bytes = 0;
};

}  // namespace voxdag
