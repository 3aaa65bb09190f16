#include "query/export/mesh/hex_mesh.h"

#include <algorithm>

#include "core/base/text.h"

namespace voxdag::query {
namespace {

std::string mesh_memory() { return "two layers of the mesh (" + less_is_needed() + ")"; }

// For one axis: `low` has the bits of a brick's mask at which bit 0 of the coordinate on the axis
// is set, and `high` has the bits at which bit 1 is set. Two cells that differ only in bit 0 of
// this coordinate have mask bits that are `low_step` apart; for bit 1, the distance is `high_step`.
struct AxisBits {
  uint64_t low, high;
  int low_step, high_step;
};
constexpr AxisBits kAxisBits[3] = {{0xf0f0f0f0f0f0f0f0ull, 0xffffffff00000000ull, 4, 32},
                                   {0xccccccccccccccccull, 0xffff0000ffff0000ull, 2, 16},
                                   {0xaaaaaaaaaaaaaaaaull, 0xff00ff00ff00ff00ull, 1, 8}};

// Returns the mask of the cells that are next to the cells of `mask` in the positive direction of
// the axis, if they are in the same brick.
uint64_t next_within(uint64_t mask, const AxisBits& axis) {
  return (mask & ~axis.low) << axis.low_step | (mask & axis.low & ~axis.high)
                                                   << (axis.high_step - axis.low_step);
}
// Returns the cells of the next brick on the axis that are next to the cells of `mask`, as a mask
// of that brick.
uint64_t next_beyond(uint64_t mask, const AxisBits& axis) {
  return (mask & axis.low & axis.high) >> (axis.low_step + axis.high_step);
}

// A brick's cells have corner points in up to eight PointBricks. Returns the mask of the points in
// the PointBrick at the offset (dx, dy, dz) from the brick. `mask` has the brick's cells. `beyond`
// is 4dx + 2dy + dz, where each is 0 or 1.
uint64_t points_of_brick(uint64_t mask, int beyond) {
  for (int axis = 0; axis < 3; ++axis)
    mask = beyond >> (2 - axis) & 1 ? next_beyond(mask, kAxisBits[axis])
                                    : mask | next_within(mask, kAxisBits[axis]);
  return mask;
}

}  // namespace

HexSlabs::HexSlabs(const ExportJob& job) {
  const Region& region = job.selection.region;
  first = region.low[0] / kBrickEdge;
  brick_counts.resize(static_cast<size_t>((region.high[0] - 1) / kBrickEdge - first + 1));
  ExportStage stage(job, "count", 0, "bricks");
  for_each_brick(job.dag, job.selection, [&](const Brick& brick) {
    ++brick_counts[static_cast<size_t>(brick.low[0] / kBrickEdge - first)];
    voxels += static_cast<uint64_t>(std::popcount(brick.mask));
    stage.advance(1);
  });
  if (voxels == 0) refuse_empty(job);
  while (brick_counts.back() == 0) brick_counts.pop_back();
}

HexSweep::Slab<HexSweep::HexBrick> HexSweep::read_slab(int64_t slab) const {
  Slab<HexBrick> bricks;
  const uint64_t count = static_cast<size_t>(slab) < slabs_.brick_counts.size()
                             ? slabs_.brick_counts[static_cast<size_t>(slab)]
                             : 0;
  if (count == 0) return bricks;
  bricks.items = PageBuffer<HexBrick>(job_.budget, count, mesh_memory());
  Selection layer = job_.selection;
  const int64_t low = (slabs_.first + slab) * kBrickEdge;
  layer.region.low[0] = std::max(layer.region.low[0], low);
  layer.region.high[0] = std::min(layer.region.high[0], low + kBrickEdge);
  for_each_brick(job_.dag, layer, [&](const Brick& brick) {
    if (bricks.count < count)
      bricks.items[bricks.count] = {place_of(brick.low[1] / kBrickEdge, brick.low[2] / kBrickEdge),
                                    brick.mask};
    ++bricks.count;
  });
  require_written(job_, bricks.count, count);
  std::ranges::sort(bricks.items.data(), bricks.items.data() + count, {}, &HexBrick::place);
  return bricks;
}

// Calls visit(place, mask) for each PointBrick of the current slab, by increasing place. A
// PointBrick can have corners of cells in up to eight bricks, so this function merges eight
// sequences of bricks.
template <class Visit>
void HexSweep::merge_points(const Visit& visit) const {
  struct Sequence {
    const HexBrick* at;
    const HexBrick* end;
    int beyond;
    uint64_t shift;  // from the brick's place to the place of the PointBrick
    uint64_t place() const { return at == end ? ~uint64_t{0} : at->place + shift; }
  };
  std::array<Sequence, 8> sequences;
  for (int i = 0; i < 8; ++i) {
    const Slab<HexBrick>& bricks = i & 4 ? bricks_before_ : bricks_;
    sequences[static_cast<size_t>(i)] = {bricks.items.data(), bricks.items.data() + bricks.count, i,
                                         place_of(i >> 1 & 1, i & 1)};
  }
  for (;;) {
    uint64_t place = ~uint64_t{0}, mask = 0;
    for (const Sequence& sequence : sequences) place = std::min(place, sequence.place());
    if (place == ~uint64_t{0}) return;
    for (Sequence& sequence : sequences)
      if (sequence.place() == place) mask |= points_of_brick(sequence.at++->mask, sequence.beyond);
    if (mask != 0) visit(place, mask);
  }
}

void HexSweep::number_points() {
  uint64_t count = 0;
  merge_points([&](uint64_t, uint64_t) { ++count; });
  points_ = {};
  if (count == 0) return;
  points_.items = PageBuffer<PointBrick>(job_.budget, count, mesh_memory());
  merge_points([&](uint64_t place, uint64_t mask) {
    points_.items[points_.count++] = {place, mask, next_point_};
    next_point_ += static_cast<uint64_t>(std::popcount(mask));
  });
}

bool HexSweep::next() {
  job_.cancel.check();
  if (slab_ == static_cast<int64_t>(slabs_.brick_counts.size())) return false;
  ++slab_;
  bricks_before_ = std::move(bricks_);
  points_before_ = std::move(points_);
  bricks_ = read_slab(slab_);
  number_points();
  for (uint64_t i = 0; i < bricks_before_.count; ++i)
    cells_ += static_cast<uint64_t>(std::popcount(bricks_before_.items[i].mask));
  return true;
}

std::array<const HexSweep::PointBrick*, 8> HexSweep::point_bricks_around(uint64_t place) const {
  std::array<const PointBrick*, 8> around{};
  for (size_t i = 0; i < 8; i += 2) {
    const Slab<PointBrick>& slab = i & 4 ? points_ : points_before_;
    const PointBrick* const end = slab.items.data() + slab.count;
    const uint64_t wanted = place + place_of(i >> 1 & 1, 0);
    const PointBrick* found =
        std::ranges::lower_bound(slab.items.data(), end, wanted, {}, &PointBrick::place);
    if (found != end && found->place == wanted) around[i] = found++;
    if (found != end && found->place == wanted + 1) around[i + 1] = found;
  }
  return around;
}

HexSweep::Points HexSweep::points_of(const std::array<const PointBrick*, 8>& around, int bit) {
  constexpr int kCorners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                  {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  Points points;
  for (size_t i = 0; i < 8; ++i) {
    const int x = brick_coordinate(bit, 0) + kCorners[i][0];
    const int y = brick_coordinate(bit, 1) + kCorners[i][1];
    const int z = brick_coordinate(bit, 2) + kCorners[i][2];
    const PointBrick& brick = *around[static_cast<size_t>(x >> 2 << 2 | y >> 2 << 1 | z >> 2)];
    const uint64_t point = uint64_t{1} << brick_bit(x & 3, y & 3, z & 3);
    points[i] = brick.first + static_cast<uint64_t>(std::popcount(brick.mask & (point - 1)));
  }
  return points;
}

HexMesh require_hex_mesh(const ExportJob& job, uint64_t limit, const std::string& reason) {
  const uint64_t voxels = require_voxels(job, limit, reason);
  HexMesh mesh{HexSlabs(job)};
  require_written(job, mesh.slabs.voxels, voxels);
  {
    ExportStage stage(job, "number points", voxels, "voxels");
    HexSweep sweep(job, mesh.slabs);
    for (uint64_t before = 0; sweep.next(); before = sweep.cells()) {
      stage.advance(sweep.cells() - before);
      stage.report();
    }
    mesh.points = sweep.points();
  }
  if (mesh.points > limit) {
    CellLimit cells(job, limit / 8);  // a cell has at most 8 points
    refuse_size(job,
                "the mesh has " + count_text(mesh.points) + " points, but " + reason + " at most " +
                    count_text(limit),
                [&](uint32_t level) { return cells.fits(level); });
  }
  return mesh;
}

std::string hex_mesh_note(const HexMesh& mesh) {
  return count_text(mesh.slabs.voxels) + " hexahedra with " + count_text(mesh.points) +
         " points, in scene units";
}

}  // namespace voxdag::query
