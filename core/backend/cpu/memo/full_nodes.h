// Makes the nodes of full cubes, which are cubes with all voxels set. There is one node for each
// size of cube. It is made when it is first needed. Not thread-safe. Throws OutOfBudget.
#pragma once

#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

class FullNodes {
 public:
  explicit FullNodes(SubDagTables& tables) : tables_(tables) {}

  // Returns the node of a full cube with an edge of 2^size_log2 voxels. Does not change the tables'
  // counts; the caller adds full_counts() to them. The caller must use the node, because every node
  // of the tables becomes a node of the sub-DAG.
  const NodeRef& node(int size_log2) {
    NodeRef& full = nodes_[size_log2];
    if (!full.exists) full = make(size_log2);
    return full;
  }

 private:
  NodeRef make(int size_log2);

  SubDagTables& tables_;
  NodeRef nodes_[kMaxGridLevels + 1];
};

}  // namespace voxdag::cpu
