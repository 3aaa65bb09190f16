#include "query/export/surface/surface.h"

#include <algorithm>
#include <bit>

#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

Position low_corner(const RowBrick& brick, uint8_t axis) {
  Position low{};
  low[axis] = static_cast<int64_t>(brick.slab()) * kBrickEdge;
  low[(axis + 1u) % 3] = static_cast<int64_t>(brick.u()) * kBrickEdge;
  low[(axis + 2u) % 3] = static_cast<int64_t>(brick.v()) * kBrickEdge;
  return low;
}

// Returns the bricks at the start of `bricks` that have the same number_of() as the first brick.
template <class NumberOf>
std::span<const RowBrick> first_group(std::span<const RowBrick> bricks, const NumberOf& number_of) {
  size_t end = 0;
  while (end < bricks.size() && number_of(bricks[end]) == number_of(bricks[0])) ++end;
  return bricks.first(end);
}

uint64_t slab_of(const RowBrick& brick) { return brick.slab(); }

const DagView& surface_dag(const ExportJob& job) { return job.filled ? *job.filled : job.dag; }

}  // namespace

Surface::Surface(const ExportJob& job, uint64_t max_rectangles)
    : job_(job),
      max_rectangles_(max_rectangles),
      clips_faces_(job.filled && !job.selects_all_of(job.selection.grid_levels)),
      colors_(job.file),
      rectangles_(job.budget, surface_memory()) {
  BrickRows bricks = read_bricks();
  ExportStage stage(job, "find faces", 6 * listed_bricks_, "bricks");
  for (uint8_t axis = 0; axis < 3; ++axis) {
    const std::span<const RowBrick> sorted = bricks.sorted(axis);
    job.cancel.check();
    for (const bool upward : {false, true}) find(sorted, {axis, upward}, stage);
  }
}

// Returns the selection, and with --outside also the cells next to it.
Selection Surface::walked() const {
  Selection selection = job_.selection;
  const int64_t edge = int64_t{1} << selection.grid_levels;
  if (job_.filled)
    for (size_t axis = 0; axis < 3; ++axis) {
      selection.region.low[axis] = std::max<int64_t>(0, selection.region.low[axis] - 1);
      selection.region.high[axis] = std::min(edge, selection.region.high[axis] + 1);
    }
  return selection;
}

BrickRows Surface::read_bricks() {
  const Selection selection = walked();
  const DagView& dag = surface_dag(job_);
  uint64_t bricks = 0, cubes = 0, sides = 0, cells = 0;
  {
    ExportStage stage(job_, "count", 0, "bricks");
    for_each_brick_or_full_cube(
        dag, selection,
        [&](const Brick& brick) {
          ++bricks;
          cells += static_cast<uint64_t>(std::popcount(brick.mask));
          stage.advance(1);
        },
        [&](const Position&, int64_t edge) {
          ++cubes;
          sides +=
              static_cast<uint64_t>(edge / kBrickEdge) * static_cast<uint64_t>(edge / kBrickEdge);
          cells += cells_of_cube(edge);
          stage.advance(1);
        });
  }
  voxels_ = job_.filled ? count_voxels(job_, job_.selection, ~uint64_t{0}) : cells;
  if (voxels_ == 0) refuse_empty(job_);
  listed_bricks_ = bricks + 2 * sides;
  BrickRows rows(job_.budget, bricks, sides, surface_memory());
  ExportStage stage(job_, "read", bricks + cubes, "bricks");
  for_each_brick_or_full_cube(
      dag, selection,
      [&](const Brick& brick) {
        stage.advance(1);
        rows.add(brick.low, brick.mask);
      },
      [&](const Position& low, int64_t edge) {
        stage.advance(1);
        rows.add_full_cube(low, edge);
      });
  return rows;
}

void Surface::find(std::span<const RowBrick> bricks, Direction direction, ExportStage& stage) {
  std::span<const RowBrick> before, slab = first_group(bricks, slab_of);
  while (!slab.empty() && !is_over_limit()) {
    bricks = bricks.subspan(slab.size());
    const std::span<const RowBrick> after = first_group(bricks, slab_of);
    const auto is_next = [&](std::span<const RowBrick> other, uint64_t number) {
      return !other.empty() && other[0].slab() == number;
    };
    const uint64_t number = slab[0].slab();
    std::span<const RowBrick> next;
    if (direction.upward && is_next(after, number + 1)) next = after;
    if (!direction.upward && is_next(before, number - 1)) next = before;
    add_slab(slab, next, direction, stage);
    before = slab;
    slab = after;
  }
}

// Adds the rectangles of a slab (brick_rows.h) whose outer sides face `direction`. `next` is the
// adjacent slab in this direction. If that slab has no bricks, `next` is empty.
void Surface::add_slab(std::span<const RowBrick> slab, std::span<const RowBrick> next,
                       Direction direction, ExportStage& stage) {
  for (PlaneRow& plane : planes_) plane.v = -2;
  size_t at = 0;  // index in `next`
  for (size_t i = 0; i < slab.size() && !is_over_limit(); ++i) {
    const RowBrick& brick = slab[i];
    stage.advance(1);
    const uint64_t place = brick.place_in_slab();
    while (at < next.size() && next[at].place_in_slab() < place) ++at;
    const bool has_neighbor = at < next.size() && next[at].place_in_slab() == place;
    add_brick(brick, has_neighbor ? next[at].mask : 0, direction);
    if (i + 1 == slab.size() || slab[i + 1].v() != brick.v())
      end_row(brick.slab(), brick.v(), direction);
  }
}

uint64_t Surface::visible_faces(const RowBrick& brick, uint64_t neighbor,
                                Direction direction) const {
  if (!brick.has_faces(direction.upward)) return 0;
  const uint64_t faces = faces_of_brick(brick.mask, neighbor, direction.axis, direction.upward);
  if (!clips_faces_ || faces == 0) return faces;
  return faces & mask_within(job_.selection.region, low_corner(brick, direction.axis));
}

voxdag_reader::Rgb Surface::color_of(const RowBrick& brick, uint8_t axis, int bit) {
  Position cell = low_corner(brick, axis);
  cell[axis] += bit >> 4;
  cell[(axis + 1u) % 3] += bit & 3;
  cell[(axis + 2u) % 3] += bit >> 2 & 3;
  return color_of_cell(job_, colors_, cell);
}

// Appends the faces of a brick to the runs of the current row of bricks.
void Surface::add_brick(const RowBrick& brick, uint64_t neighbor, Direction direction) {
  const uint64_t faces = visible_faces(brick, neighbor, direction);
  if (faces == 0) return;
  const auto low_u = static_cast<uint32_t>(brick.u() * kBrickEdge);
  for (uint64_t rest = orders_[direction.axis](faces); rest != 0;) {
    // Takes the next cells that are adjacent in a row; with colors, only one cell.
    const int bit = std::countr_zero(rest);
    const int in_row = std::min(std::countr_one(rest >> bit), kBrickEdge - bit % kBrickEdge);
    voxdag_reader::Rgb color{};
    int count = in_row;
    if (job_.has_colors) {
      color = color_of(brick, direction.axis, bit);
      count = 1;
    }
    rest &= ~(((uint64_t{1} << count) - 1) << bit);
    const uint32_t u0 = low_u + static_cast<uint32_t>(bit % kBrickEdge);
    std::vector<Run>& runs = runs_[static_cast<size_t>(bit / kBrickEdge)];
    if (!runs.empty() && runs.back().u1 == u0 && runs.back().color == color)
      runs.back().u1 += static_cast<uint32_t>(count);
    else
      runs.push_back({u0, u0 + static_cast<uint32_t>(count), color});
  }
}

void Surface::end_row(uint64_t slab, uint64_t v, Direction direction) {
  const Position& low = job_.selection.region.low;
  for (size_t i = 0; i < 4; ++i) {
    const auto plane = static_cast<int64_t>(slab * kBrickEdge + i) + direction.upward;
    for (size_t j = 0; j < 4; ++j) {
      std::vector<Run>& runs = runs_[4 * i + j];
      if (runs.empty()) continue;
      merge(runs, planes_[i], static_cast<int64_t>(v * kBrickEdge + j),
            static_cast<uint32_t>(plane - low[direction.axis]), direction);
      runs.clear();
    }
  }
}

// Adds a row of runs to its plane. If the row before it has a rectangle with the same color, u0 and
// u1 as a run, the run extends the rectangle. Otherwise the run begins a new rectangle.
void Surface::merge(const std::vector<Run>& runs, PlaneRow& last, int64_t v, uint32_t plane,
                    Direction direction) {
  const Position& low = job_.selection.region.low;
  const auto low_u = static_cast<uint32_t>(low[(direction.axis + 1u) % 3]);
  const auto v0 = static_cast<uint32_t>(v - low[(direction.axis + 2u) % 3]);
  if (last.v + 1 != v) last.rectangles.clear();
  last.v = v;
  row_.clear();
  size_t candidate = 0;
  for (const Run& run : runs) {
    const uint32_t u0 = run.u0 - low_u, u1 = run.u1 - low_u;
    while (candidate < last.rectangles.size() && rectangles_[last.rectangles[candidate]].u0 < u0)
      ++candidate;
    if (candidate < last.rectangles.size()) {
      SurfaceRectangle& before = rectangles_[last.rectangles[candidate]];
      if (before.u0 == u0 && before.u1 == u1 && before.color == run.color) {
        before.v1 = v0 + 1;
        row_.push_back(last.rectangles[candidate]);
        continue;
      }
    }
    row_.push_back(rectangles_.size());
    rectangles_.push_back({plane, u0, v0, u1, v0 + 1, direction.upward, direction.axis, run.color});
  }
  last.rectangles.swap(row_);
}

}  // namespace voxdag::query
