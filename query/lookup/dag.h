// A finished file, to ask for points, colors, rays, boxes, counts and neighbors: what bindings to
// other languages are made on. docs/query.md describes conventions and units.
//
// The file is mapped, not read. A batch function takes any number of items in one call, works on
// them on up to `threads` threads, the caller's among them, and allocates nothing per item; the
// results do not depend on the threads. Spans of one call have equal lengths.
//
// A grid is chosen by its levels: that of 2^grid_levels cells per edge, a cell being set where any
// voxel in it is. Those of the file, grid_levels(), mean its voxels.
//
// All functions are const and thread-safe. They throw Error{kInvalidInput} for arguments that break
// their rules, and Error{kCorrupt} that names the file if what they read of it is damaged: offsets
// are checked on the way, checksums are not (voxdag verify does that).
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "core/base/memory_budget.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "query/dag/selection.h"
#include "query/lookup/bricks.h"
#include "query/lookup/nearest.h"
#include "query/lookup/node_counts.h"
#include "query/lookup/position.h"
#include "query/lookup/top_cells.h"

namespace voxdag::query {

// Three coordinates in voxels; the grid is the cube [0, R]^3.
using Coordinates = std::array<double, 3>;

// sRGB as it is shown, and alpha: 255 for a color, 0 where there is none.
using Rgba = std::array<uint8_t, 4>;

struct RayLimits {
  double max_distance = std::numeric_limits<double>::infinity();  // in voxels
  // Cells of at most so many voxels per edge are hit as a whole; below 2 only voxels are.
  double stop_size = 0;
};

struct RayHit {
  double distance = 0;       // in voxels, from the origin to the face
  Position cell{};           // in the grid of 2^grid_levels
  uint32_t grid_levels = 0;  // of the grid whose cell was hit
  // The normal of the face by which the ray entered: 0, 1, 2 for x, y, z, and 1 or -1. A ray that
  // begins in the cell has distance 0, and axis -1 and sign 0, no face.
  int8_t axis = -1;
  int8_t sign = 0;
  bool hit = false;  // the other members have meaning only if there is a hit
};

class Dag {
 public:
  // The counts of nodes that count() stores take at most so much memory by default, bytes.
  static constexpr uint64_t kDefaultMemory = uint64_t{1} << 30;

  // Opens and maps the file. What count() stores is charged to a budget of `memory_bytes`. Throws
  // Error{kNotFound}, Error{kIo}, Error{kUnsupportedVersion}, or Error{kCorrupt} for a damaged
  // header.
  explicit Dag(const std::string& path, uint64_t memory_bytes = kDefaultMemory);

  const voxdag_reader::File& file() const { return *file_; }
  const DagView& view() const { return view_; }
  uint32_t grid_levels() const { return view_.grid_levels(); }

  // set[i] becomes 1 if cell points[i] is set, 0 if it is not or lies outside the grid.
  void lookup(std::span<const Position> points, uint32_t grid_levels, std::span<uint8_t> set,
              unsigned threads = 1) const;

  // Whether the cells of a grid have colors: those of 2^color_levels() cells per edge and coarser
  // ones their own, finer ones that of the cell that they lie in. An empty scene has none.
  bool has_colors() const { return file_->has_colors(); }
  uint32_t color_levels() const { return file_->color_levels(); }
  // colors[i] becomes the color of cell points[i]; all four are 0 if it is not set or lies outside
  // the grid. Cells near each other that follow each other are faster. Throws Error{kInvalidInput}
  // for a file without colors.
  void colors(std::span<const Position> points, uint32_t grid_levels, std::span<Rgba> colors,
              unsigned threads = 1) const;

  // The first set cell on each ray. Directions have any length but 0; all numbers are finite, and
  // limits not negative. A cell includes its faces, so that no ray passes between two cells that
  // share one. Rays that follow each other closely, as those of neighboring pixels, are faster.
  void rays(std::span<const Coordinates> origins, std::span<const Coordinates> directions,
            const RayLimits& limits, std::span<RayHit> hits, unsigned threads = 1) const;

  // The region as a dense array, 1 for each set cell: that of position p is at
  // ((p.x - low.x) * ny + p.y - low.y) * nz + p.z - low.z. The region may reach out of the grid;
  // `cells` has its size.
  void box(const Selection& selection, std::span<uint8_t> cells) const;

  // The positions of the set cells in the region, in Morton order: stores the first as many as fit
  // and returns how many there are.
  uint64_t positions(const Selection& selection, std::span<Position> positions) const;

  // Calls `visit` for each brick of 4x4x4 cells with set ones in the region, in Morton order; see
  // query/lookup/bricks.h.
  void bricks(const Selection& selection, const std::function<void(const Brick&)>& visit) const;

  // Set cells in the region. The first count in a grid reads every node of its levels once, and
  // stores a number for each.
  uint64_t count(const Selection& selection) const;

  // For each point the set cell that is nearest, from center to center, at most `max_distance`
  // cells away; of several the one with the lowest Morton code. Coordinates are at most
  // kMaxCoordinate, inside the grid or not.
  void nearest(std::span<const Position> points, uint32_t grid_levels, double max_distance,
               std::span<Nearest> cells, unsigned threads = 1) const;

 private:
  const NodeCounts& counts(uint32_t grid_levels) const;
  void expect_questions(size_t count) const;
  const TopCells* top_cells(size_t points) const;

  const std::unique_ptr<voxdag_reader::File> file_;
  const DagView view_;
  mutable MemoryBudget budget_;
  mutable std::once_flag huge_pages_, make_top_;
  mutable std::atomic<uint64_t> points_asked_ = 0;
  mutable std::optional<TopCells> top_;  // as soon as there were many points
  mutable std::mutex mutex_;
  mutable std::array<std::unique_ptr<NodeCounts>, 21> counts_;  // by grid levels; under mutex_
};

}  // namespace voxdag::query
