// The report of a finished merge.
#pragma once

#include <cstdint>

namespace voxdag {

struct MergeReport {
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;  // including the top tree
  uint64_t dag_nodes = 0;
  uint64_t input_nodes = 0;      // rows of all runs of all passes
  uint32_t passes = 0;           // 1 if all runs were merged in one pass
  uint64_t scratch_bytes = 0;    // bytes written to the scratch folder
  uint64_t hash_partitions = 0;  // number of partitions on all levels of all passes
  uint64_t streamed_groups = 0;  // groups of equal hashes that did not fit in memory
};

}  // namespace voxdag
