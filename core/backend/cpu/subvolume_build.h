// Builds the sub-DAG of one subvolume. Descends the octree to tiles (cubes of at most 64^3 voxels)
// and passes each triangle of a cube to the children that the triangle may touch. Then draws the
// triangles of each tile and reduces the tile to a node. On the way back, combines nodes up to the
// root.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/backend/backend.h"
#include "core/backend/cpu/memo/full_nodes.h"
#include "core/backend/cpu/memo/plane_memo.h"
#include "core/backend/cpu/memo/tile_reducer.h"
#include "core/backend/cpu/raster/kernels.h"
#include "core/backend/cpu/raster/triangle_set.h"
#include "core/backend/cpu/solid/solid_fill.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

// Used for one build, by one thread. Throws OutOfBudget, before the sink is called, if the budget
// is too small.
class SubvolumeBuild {
 public:
  SubvolumeBuild(const SubvolumeTask& task, const Kernels& kernels, PooledMemory& memory,
                 const CancelToken& cancel, const TableSizes& expected);
  SubDagSummary run(TriangleStream& stream, SubDagSink& sink);
  // Returns the sizes of the tables after run().
  TableSizes table_sizes() const { return tables_.sizes(); }

 private:
  NodeRef build_streamed(TriangleStream& stream);
  void read(TriangleStream& stream);
  // If a triangle of entries_[first, first + count) covers the cube of these entries, and all
  // others are in its plane, returns the covering triangle: it sets all voxels that they set
  // together. Otherwise returns null.
  const Entry* covering(size_t first, size_t count) const;
  // Returns the node of a cube with an edge of 2^size_log2 voxels. The triangles that may touch the
  // cube are entries_[first, first + count).
  NodeRef build(int size_log2, const LatticeCube& cube, size_t first, size_t count);
  // The result of build_solid() for a cube of a solid. For a cube without voxels of the shell,
  // `is_empty` is true and there is no node yet. build_solid() for the cube's parent then chooses
  // the node by SolidFill::decide(), unless the parent is also empty.
  struct SolidNode {
    NodeRef node;
    bool is_empty = false;
  };
  // build() for a solid.
  SolidNode build_solid(int size_log2, const LatticeCube& cube, size_t first, size_t count);
  // Sets `node` to the node of a tile that the triangle `entry` covers and no other triangle
  // touches. Returns false if the tile needs build_solid_tile().
  bool build_solid_plane(const LatticeCube& tile, Entry entry, SolidNode& node);
  // Finds the views of a tile, and builds its node.
  SolidNode build_solid_tile(const LatticeCube& tile, size_t first, size_t count);
  // Returns the node of a tile whose views are known, or of a cube within it.
  SolidNode build_solid_part(int size_log2, const LatticeCube& cube, size_t first, size_t count);
  bool build_solid_part_plane(int size_log2, const LatticeCube& cube, Entry entry, SolidNode& node);
  SolidNode draw_solid_part(int size_log2, const LatticeCube& cube, size_t first, size_t count);
  // Builds the children of a cube by build_child(child's size_log2, child, first, count), and
  // combines them. The entries of the cube are entries_[first, first + count).
  template <class BuildChild>
  SolidNode split_solid(int size_log2, const LatticeCube& cube, size_t first, size_t count,
                        BuildChild build_child);
  NodeRef finish_solid_root(const SolidNode& root);
  // Calls see(triangle) for the triangles entries_[first, first + count).
  template <class See>
  void visit(size_t first, size_t count, const See& see) const;

  // The entries of a cube's child c are entries_[first[c], first[c] + counts[c]).
  struct ChildEntries {
    size_t first[8];
    size_t counts[8] = {};
  };
  // Adds the entries of the children of `cube` to the stack. The entries of `cube` are
  // entries_[first, first + count).
  ChildEntries push_children(const LatticeCube& cube, size_t first, size_t count);
  // True if splitting a cube of at most tile size is likely to be faster than drawing it, because
  // the nodes of its parts can be in the plane memo.
  bool is_worth_splitting(int size_log2, size_t first, size_t count);
  NodeRef build_tile(int size_log2, const LatticeCube& cube, size_t first, size_t count);
  Octants test_octants(Entry entry, const LatticeCube& cube) const;
  void draw(const WideTriangle& triangle, const LatticeCube& tile);
  void draw(Entry entry, const LatticeCube& tile);
  void draw_narrow(const NarrowTriangle& triangle, bool inside, const LatticeCube& tile);
  void draw_wide(const WideTriangle& triangle, bool inside, const LatticeCube& tile);
  void reserve_entries(size_t count);

  const SubvolumeTask task_;
  const Kernels& kernels_;
  PooledMemory& memory_;
  const CancelToken& cancel_;
  TriangleSet triangles_;
  // entries_ is a stack. For each cube from the root to the current cube, it has the triangles that
  // may touch the cube. For each of the current cube's entries, octants_ has two masks: bits 0-7
  // are the children that the triangle may touch, bits 8-15 are the children that it covers (see
  // Entry in triangle_set.h).
  PooledArray<Entry> entries_;
  PooledArray<uint16_t> octants_;
  size_t entries_used_ = 0;
  SubDagTables tables_;
  FullNodes full_;
  TileReducer reducer_;
  PlaneMemo planes_;
  TileBricks tile_;
  std::optional<SolidFill> solid_;
};

}  // namespace voxdag::cpu
