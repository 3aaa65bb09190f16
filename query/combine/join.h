// Finds the equal nodes of two files. Without this step, combine() would visit almost all nodes of
// two large files that differ only in a small place.
//
// Join works from the bricks up. On each level, it computes the hashes of all nodes. The nodes of a
// level are sorted by hash in both files, so Join finds candidates for equal nodes by merging the
// two sequences. A node of the second file is equal to a node of the first file if their masks are
// equal and their children are equal nodes. So the result does not depend on hashes that are equal
// by chance.
//
// Join also checks two conditions that later steps rely on: every pointer points to a node, and the
// nodes of a level are in the total order (docs/format.md). It throws Error{kCorrupt} otherwise.
#pragma once

#include <cstdint>
#include <memory>

#include "query/combine/operation.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

// The memory for the values (node_values.h) of one level of one file, and the memory for the
// windows and buckets of lookups in these values.
struct LookupMemory {
  uint64_t value_bytes = 0;
  uint64_t window_bytes = 0;
};

// The results of Join for one level of both files. A node is named by its word offset in its level.
struct JoinedLevel {
  // `hash_space` is the space of the lists of hashes.
  JoinedLevel(const SpillSpace& space, const SpillSpace& hash_space)
      : hashes_a(hash_space), hashes_b(hash_space), equal(space) {}

  // Hashes of all nodes of the level, in the order of the file.
  SpillList<uint64_t> hashes_a;
  SpillList<uint64_t> hashes_b;
  SpillList<NodePair> equal;  // in increasing order of both offsets
  NodePair full;              // the nodes in which all voxels are set, if any
};

class Join {
 public:
  Join(DagInput& a, DagInput& b, const SpillSpace& space, const LookupMemory& memory);
  ~Join();

  // Hashes the nodes of one level of both files and finds the equal nodes. Stores the results in
  // `joined`; joined.hashes_a is complete after the next call. Call it for each level, from the
  // bricks up.
  void add_level(uint32_t level, JoinedLevel& joined);
  // Must be called after the last level.
  void finish();

 private:
  struct Below;
  DagInput& a_;
  DagInput& b_;
  const SpillSpace& space_;
  const LookupMemory memory_;
  std::unique_ptr<Below> below_;  // the level joined last
};

}  // namespace voxdag::query
