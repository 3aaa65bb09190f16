#include "scheduler/stages/plan/solid_pilot.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/popcount8.h"
#include "core/dag/space/cube_walk.h"
#include "core/dag/space/enclosed_fill.h"
#include "core/dag/space/space_labels.h"
#include "scheduler/solid/row_sums.h"
#include "scheduler/stages/rows/outside_rows.h"
#include "scheduler/stages/rows/row_column.h"

namespace voxdag {

PilotRows::PilotRows(MemoryBudget& budget, uint32_t levels) : budget_(budget), levels_(levels) {
  // read() also needs memory for the sums, which are as large as the views, and for a column.
  const uint64_t views = row_bytes(Cube{}, levels);
  const uint64_t column = RowColumn::bytes(TileGrid(levels), Cube{});
  if (budget.available() < 2 * views + column) throw OutOfBudget();
  charge_ = MemoryCharge(budget, views, "the sample rows of a pilot");
}

void PilotRows::read(SolidRule rule, TriangleStream& triangles, BuildScene* beyond, Grid grid,
                     const StageContext& context) {
  RowSums sums(Cube{}, levels_, budget_);
  std::array<FixedTriangle, 256> batch;
  triangles.rewind();
  while (const size_t n = triangles.read(batch)) {
    context.build.cancel.check();
    for (const FixedTriangle& triangle : std::span(batch).first(n)) sums.add(triangle);
  }
  triangles.rewind();
  std::optional<OutsideRows> outside;
  if (beyond != nullptr) {
    grid.levels = levels_;
    outside.emplace(levels_, budget_);
    outside->read(beyond->open(), grid, context);
  }
  entry_.rule = rule;
  for (int axis = 0; axis < 3; ++axis) {
    RowColumn column(TileGrid(levels_), rule, axis, Cube{}, budget_);
    column.add_total(Cube{}, sums.numbers(axis));
    if (outside)
      outside->for_each([&](int a, int first, int second, const OutsideTile& tile) {
        if (a == axis) column.add_outside(first, second, tile);
      });
    column.count(counts_);
    column.begin();
    entry_.views[axis].resize(rows_per_axis(Cube{}, levels_));
    column.entry(Cube{}, entry_.views[axis]);
  }
}

void ShellLevels::bricks(const BrickLevelView& level) {
  levels_.brick_rows = level.masks.size();
  levels_.bricks = PooledArray<uint64_t>(memory_, level.masks.size());
  std::ranges::copy(level.masks, levels_.bricks.begin());
}

void ShellLevels::nodes(const NodeLevelView& level) {
  NodeLevels::Level& out = levels_.nodes.emplace_back();
  out.rows = level.masks.size();
  out.masks = PooledArray<uint8_t>(memory_, out.rows);
  out.first_child = PooledArray<uint32_t>(memory_, out.rows);
  out.children = PooledArray<uint32_t>(memory_, level.children.size());
  std::ranges::copy(level.masks, out.masks.begin());
  std::ranges::copy(level.children, out.children.begin());
  uint32_t first = 0;
  for (size_t row = 0; row < out.rows; ++row) {
    out.first_child[row] = first;
    first += static_cast<uint32_t>(popcount8(level.masks[row]));
  }
}

NodeLevels ShellLevels::finish() {
  std::ranges::reverse(levels_.nodes);
  return std::move(levels_);
}

namespace {

// Returns the nodes of `tables`, which must not be empty.
NodeLevels take_levels(PooledMemory& memory, SubDagTables& tables) {
  ShellLevels out(memory);
  emit_levels(tables, {0, static_cast<uint32_t>(tables.size_log2()), 64}, out);
  return out.finish();
}

// Returns the closed positions of a walking cube (core/dag/space/cube_walk.h). They are in a grid
// of twice the resolution, whose octant with the largest coordinates is the grid of the voxels.
NodeLevels closed_positions(PooledMemory& memory, const NodeLevels& shell,
                            const std::optional<Seed>& seed, uint32_t radius, uint32_t levels) {
  const int size_log2 = static_cast<int>(levels);
  SubDagTables blocked_tables(memory, size_log2 + 1);
  NodeRef octants[8];
  for (size_t o = 0; o < 8; ++o) {
    CubeNeighbors around;
    around[7 - o].levels = &shell;
    octants[o] = add_blocked(memory, around, size_log2, radius, blocked_tables);
  }
  blocked_tables.add_node(size_log2 + 1, octants);
  const NodeLevels blocked = take_levels(memory, blocked_tables);
  SpaceLabels labels(memory, blocked);
  SubDagTables closed(memory, size_log2 + 1);
  const std::vector<uint8_t> is_outside(labels.count(0, 0), 1);
  if (seed)
    fill_from_seed(memory, labels, is_outside, start_position(*seed, radius, levels), closed);
  else
    fill_enclosed(memory, labels, is_outside, closed);
  return take_levels(memory, closed);
}

SubDagSummary fill_sealed(PooledMemory& memory, const NodeLevels& shell,
                          const std::optional<Seed>& seed, uint32_t radius, uint32_t levels,
                          SubDagSink& sink) {
  const NodeLevels closed = closed_positions(memory, shell, seed, radius, levels);
  CubeNeighbors around;
  for (int n = 0; n < 8; ++n)
    if (closed.has_child(0, 0, 7 - n))
      around[static_cast<size_t>(n)] = {&closed, 1, closed.child(0, 0, 7 - n)};
  SubDagTables tables(memory, static_cast<int>(levels));
  add_enclosed(memory, around, static_cast<int>(levels), radius, tables);
  return emit_levels(tables, {0, levels, 64}, sink);
}

}  // namespace

SubDagSummary fill_pilot(PooledMemory& memory, const NodeLevels& shell,
                         const std::optional<Seed>& seed, uint32_t radius, uint32_t levels,
                         SubDagSink& sink) {
  if (radius > 0) return fill_sealed(memory, shell, seed, radius, levels, sink);
  SpaceLabels labels(memory, shell);
  // Labels exist for the components that reach a face of the cube. The faces are the border of
  // the grid, so all these components are outside.
  const std::vector<uint8_t> is_outside(labels.count(0, 0), 1);
  SubDagTables tables(memory, static_cast<int>(levels));
  if (seed)
    fill_from_seed(memory, labels, is_outside, seed->voxel, tables);
  else
    fill_enclosed(memory, labels, is_outside, tables);
  return emit_levels(tables, {0, levels, 64}, sink);
}

}  // namespace voxdag
