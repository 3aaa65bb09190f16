#include "scheduler/stages/rows/row_column.h"

#include <algorithm>

namespace voxdag {
namespace {

constexpr uint32_t kTileEdgeLog2 = 6;

}  // namespace

TileGrid::TileGrid(uint32_t grid_levels)
    : levels(grid_levels - std::min(grid_levels, kTileEdgeLog2)),
      blocks(1 << (std::min(grid_levels, kTileEdgeLog2) -
                   static_cast<uint32_t>(solid_block_log2(grid_levels)))) {}

uint64_t RowColumn::bytes(const TileGrid& grid, const Cube& square) {
  const auto tiles = static_cast<uint64_t>(grid.tiles_along(square));
  return tiles * tiles * kSquare * sizeof(int32_t) * 17 / 8;
}

RowColumn::RowColumn(const TileGrid& grid, SolidRule rule, int axis, const Cube& square,
                     MemoryBudget& budget)
    : grid_(grid),
      rule_(rule),
      first_axis_(first_row_axis(axis)),
      second_axis_(second_row_axis(axis)),
      first_low_(grid.low(square, first_axis_)),
      second_low_(grid.low(square, second_axis_)),
      tiles_(grid.tiles_along(square)),
      charge_(budget, bytes(grid, square), "a column of sample rows"),
      totals_(static_cast<size_t>(tiles_) * static_cast<size_t>(tiles_) * kSquare),
      crossed_(totals_.size()) {}

size_t RowColumn::tile_index(int first, int second) const {
  return (static_cast<size_t>(first - first_low_) * static_cast<size_t>(tiles_) +
          static_cast<size_t>(second - second_low_)) *
         kSquare;
}

template <class Visit>
void RowColumn::for_each_row(const Cube& cube, Visit visit) const {
  const int edge = grid_.tiles_along(cube), blocks = grid_.blocks;
  const int first = grid_.low(cube, first_axis_), second = grid_.low(cube, second_axis_);
  const int stride = edge * blocks + 1;
  for (int f = 0; f < edge; ++f)
    for (int s = 0; s < edge; ++s) {
      const size_t tile = tile_index(first + f, second + s);
      for (int i = 0; i <= blocks; ++i)
        for (int j = 0; j <= blocks; ++j)
          visit(static_cast<size_t>((f * blocks + i) * stride + s * blocks + j),
                tile + static_cast<size_t>(kRows * i + j));
    }
}

void RowColumn::add_total(const Cube& cube, const std::vector<int32_t>& numbers) {
  for_each_row(cube, [&](size_t row, size_t at) {
    totals_[at] += row_sum(numbers[row]);
    if (has_crossing(numbers[row])) crossed_[at] = true;
  });
}

void RowColumn::add_outside(int first, int second, const OutsideTile& outside) {
  if (before_.empty()) before_.resize(totals_.size());
  const size_t tile = tile_index(first, second);
  for (size_t row = 0; row < kSquare; ++row) {
    totals_[tile + row] += row_sum(outside.total[row]);
    if (has_crossing(outside.total[row])) crossed_[tile + row] = true;
    before_[tile + row] = outside.before[row];
  }
}

void RowColumn::count(RowCounts& counts) const {
  for (int f = first_low_; f < first_low_ + tiles_; ++f)
    for (int s = second_low_; s < second_low_ + tiles_; ++s) {
      const size_t tile = tile_index(f, s);
      const auto number = [&](int row) {
        const size_t at = tile + static_cast<size_t>(row);
        return 2 * totals_[at] + (crossed_[at] ? 1 : 0);
      };
      count_tile(grid_, f, s, number, counts);
    }
}

void RowColumn::begin() {
  for (size_t at = 0; at < totals_.size(); ++at)
    totals_[at] = view_of(rule_, before_.empty() ? 0 : before_[at], totals_[at]);
}

void RowColumn::entry(const Cube& cube, std::vector<int32_t>& views) const {
  for_each_row(cube, [&](size_t row, size_t at) { views[row] = totals_[at]; });
}

void RowColumn::advance(const Cube& cube, const std::vector<int32_t>& numbers) {
  for_each_row(cube, [&](size_t row, size_t at) {
    totals_[at] = view_after(rule_, totals_[at], row_sum(numbers[row]));
  });
}

int32_t RowColumn::corner(const Cube& cube, int c) const {
  const int last = grid_.tiles_along(cube) - 1;
  const int first = child_coordinate(c, first_axis_), second = child_coordinate(c, second_axis_);
  const size_t tile = tile_index(grid_.low(cube, first_axis_) + first * last,
                                 grid_.low(cube, second_axis_) + second * last);
  return totals_[tile + static_cast<size_t>((kRows * first + second) * grid_.blocks)];
}

}  // namespace voxdag
