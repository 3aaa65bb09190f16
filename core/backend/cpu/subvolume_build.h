// Building the sub-DAG of one subvolume: triangles are handed down the octree to tiles, tiles are
// drawn and reduced to nodes, nodes to the root.
#pragma once

#include <cstdint>
#include <vector>

#include "core/backend/backend.h"
#include "core/backend/cpu/kernels.h"
#include "core/backend/cpu/memo/plane_memo.h"
#include "core/backend/cpu/tables/sub_dag_tables.h"
#include "core/backend/cpu/tables/tile_reducer.h"
#include "core/backend/cpu/triangle_set.h"

namespace voxdag::cpu {

// Used once. Throws Outgrown, before the sink was called, when the budget is too small.
class SubvolumeBuild {
 public:
  SubvolumeBuild(const SubvolumeTask& task, const Kernels& kernels, Memory& memory,
                 const CancelToken& cancel, const TableSizes& expected);
  SubDagSummary run(TriangleStream& stream, SubDagSink& sink);
  // After run().
  TableSizes table_sizes() const { return tables_.sizes(); }

 private:
  NodeRef build_streamed(TriangleStream& stream);
  void read(TriangleStream& stream);
  // The node of a cube of 2^size_log2 voxels that the entries [first, first + count) of the stack
  // may touch.
  NodeRef build(int size_log2, const Box& cube, size_t first, size_t count);
  // Whether a cube of tile size, or less, is better split, since its parts may be remembered.
  bool worth_splitting(int size_log2, size_t first, size_t count);
  NodeRef build_tile(int size_log2, const Box& cube, size_t first, size_t count);
  Octants test_octants(Entry entry, const Box& cube) const;
  void draw(const WideTriangle& triangle, const Box& tile);
  void draw(Entry entry, const Box& tile);
  void reserve_entries(size_t count);

  const SubvolumeTask task_;
  const Kernels& kernels_;
  Memory& memory_;
  const CancelToken& cancel_;
  TriangleSet triangles_;
  // Entries of the cubes on the way from the root to the current one, and the octants of those
  // being handed down.
  Buffer<Entry> entries_;
  Buffer<uint16_t> octants_;
  size_t entries_used_ = 0;
  SubDagTables tables_;
  TileReducer reducer_;
  PlaneMemo planes_;
  TileBricks tile_;
};

}  // namespace voxdag::cpu
