#include "scheduler/stages/rows/outside_rows.h"

#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "scheduler/solid/row_sums.h"
#include "scheduler/stages/ingest/read_pieces.h"

namespace voxdag {
namespace {

constexpr uint64_t kBytesOfTile = sizeof(OutsideTile) + 96;  // a tile and its node in the map

// Collects the triangles of one piece of the scene that extend beyond the grid, if a sample row of
// the grid can cross them.
class LeavingPiece {
 public:
  explicit LeavingPiece(const Grid& grid)
      : grid_(grid), end_(static_cast<double>(grid.resolution() * kUnitsPerVoxel)) {}

  void read(TriangleCursor& cursor, uint64_t first, uint64_t count) {
    triangles_.clear();
    where_ = "triangles " + std::to_string(first) + " to " + std::to_string(first + count - 1) +
             " of the scene: ";
    cursor.read_snapped(first, count, grid_, [this](std::span<const SnappedTriangle> batch) {
      for (const SnappedTriangle& triangle : batch) add(triangle);
    });
  }
  const std::vector<FixedTriangle>& triangles() const { return triangles_; }

 private:
  void add(const SnappedTriangle& snapped) {
    const auto& u = snapped.v;
    bool leaves = false, is_far = false;
    int outside = 0;  // number of axes along which the triangle misses the grid
    for (int a = 0; a < 3; ++a) {
      const double low = std::min(std::min(u[0][a], u[1][a]), u[2][a]);
      const double high = std::max(std::max(u[0][a], u[1][a]), u[2][a]);
      leaves |= low < 0 || high > end_;
      outside += high < 0 || low > end_ ? 1 : 0;
      const auto limit = static_cast<double>(kCoordinateLimit);
      is_far |= !(low > -limit && high < limit);
    }
    if (!leaves || outside > 1) return;
    if (is_far)
      throw Error(ErrorCode::kLimit,
                  where_ +
                      "a triangle that sample rows of the solid can cross has a vertex 2^32 or "
                      "more voxels away from the grid's low corner: expected less than 2^32 voxels "
                      "on each axis (" +
                      option_text("bounds") + ")");
    FixedTriangle& triangle = triangles_.emplace_back();
    for (int i = 0; i < 3; ++i)
      for (int a = 0; a < 3; ++a) triangle.v[i][a] = static_cast<int64_t>(u[i][a]);
  }

  const Grid& grid_;
  const double end_;   // the grid's high corner, in lattice units
  std::string where_;  // names the triangles that are being read, for messages
  std::vector<FixedTriangle> triangles_;
};

}  // namespace

OutsideRows::OutsideRows(uint32_t grid_levels, MemoryBudget& budget)
    : grid_(grid_levels), rows_(sample_rows_of(Cube{}, grid_levels)), budget_(budget) {}

void OutsideRows::read(TriangleSource& scene, const Grid& grid, const StageContext& context) {
  uint64_t position = 0;
  read_pieces<LeavingPiece>(
      scene, position, context, [&](auto& piece) { piece.emplace(grid); },
      [&](const LeavingPiece& piece, uint64_t end) {
        for (const FixedTriangle& triangle : piece.triangles()) add(triangle);
        position = end;
      });
}

void OutsideRows::add(const FixedTriangle& triangle) {
  const int64_t end = int64_t{rows_.blocks} << rows_.pitch_log2;
  for (int a = 0; a < 3; ++a) {
    if (triangle.low(a) > 0 && triangle.high(a) < end) continue;
    rows_.for_each_crossing(triangle, a, [&](int i, int j, int64_t block, int sign) {
      if (block < 0 || block >= rows_.blocks) add(a, i, j, block < 0, sign);
    });
  }
}

void OutsideRows::add(int axis, int i, int j, bool is_before, int sign) {
  const int tiles = 1 << grid_.levels, blocks = grid_.blocks;
  // A row on a border between tiles is in all of these tiles.
  for (int f = i / blocks; f >= 0 && f * blocks + blocks >= i; --f)
    for (int s = j / blocks; s >= 0 && s * blocks + blocks >= j; --s) {
      if (f >= tiles || s >= tiles) continue;
      const auto [found, is_new] = tiles_.try_emplace({axis, f, s});
      if (is_new && charge_.bytes() < tiles_.size() * kBytesOfTile)
        charge_ = MemoryCharge(budget_, 2 * tiles_.size() * kBytesOfTile,
                               "sample rows outside the grid of a solid");
      OutsideTile& tile = found->second;
      const int row = RowColumn::kRows * (i - f * blocks) + j - s * blocks;
      add_crossing(tile.total[row], sign);
      if (is_before) tile.before[row] += sign;
    }
}

const OutsideTile* OutsideRows::find(int axis, int first, int second) const {
  const auto found = tiles_.find({axis, first, second});
  return found == tiles_.end() ? nullptr : &found->second;
}

}  // namespace voxdag
