// Disk and memory that depend on the number of subvolumes. The smaller the subvolumes, the more
// nodes occur in several of them, and the more records and lists of subvolumes exist.
#pragma once

#include <cstdint>

#include "scheduler/stages/ingest/ingest_stage.h"
#include "scheduler/stages/plan/estimate_range.h"

namespace voxdag {

struct SubvolumeCosts {
  EstimateRange artifact_nodes;  // nodes of all artifacts
  EstimateRange artifact_bytes;  // all artifacts and their records
  EstimateRange memory_bytes;    // lists and triangles of subvolumes
};

// Returns the expected number of subvolumes after all splits. `longest_edge` is the option
// --subvolume, or 0. The build splits planned subvolumes with longer edges.
double expected_subvolumes(const PreparedScene& scene, uint64_t longest_edge);

// Estimates the costs of `subvolumes` subvolumes from the nodes of the octree and of the global
// DAG.
SubvolumeCosts estimate_subvolumes(double subvolumes, double octree_nodes,
                                   const EstimateRange& dag_nodes);

// Returns an upper bound of the bytes that artifacts have in addition to their nodes.
double max_bytes_around_artifacts(double subvolumes);

}  // namespace voxdag
