#include "query/combine/moved.h"

#include <algorithm>
#include <utility>

#include "core/base/host_device.h"
#include "core/dag/brick.h"
#include "core/format/global/open_global.h"

namespace voxdag::query {
namespace {

// See has_voxels_outside().
class OutsideSearch {
 public:
  OutsideSearch(const voxdag_reader::File& b, const std::array<int64_t, 3>& offset,
                int64_t resolution)
      : b_(b), offset_(offset), resolution_(resolution) {}
  bool find() { return !b_.empty() && find(0, 0, offset_, b_.resolution()); }

 private:
  static constexpr uint64_t kMaxCubes = uint64_t{1} << 18;

  // `place` is the place (open_global.h) of a cube with voxels, `low` its lowest voxel in the grid
  // of the first file.
  bool find(uint32_t level, uint64_t place, const std::array<int64_t, 3>& low, int64_t edge) {
    bool is_inside = true;
    for (const int64_t at : low) {
      if (at + edge <= 0 || at >= resolution_) return true;
      is_inside = is_inside && at >= 0 && at + edge <= resolution_;
    }
    if (is_inside || ++cubes_ > kMaxCubes) return false;
    const uint32_t mask = child_mask_at(b_, level, place);
    for (int i = 0; i < 8; ++i)
      if (mask >> i & 1 && find(level + 1, child_place_at(b_, level, place, i),
                                {low[0] + (i >> 2 & 1) * edge / 2, low[1] + (i >> 1 & 1) * edge / 2,
                                 low[2] + (i & 1) * edge / 2},
                                edge / 2))
        return true;
    return false;
  }

  const voxdag_reader::File& b_;
  const std::array<int64_t, 3> offset_;
  const int64_t resolution_;
  uint64_t cubes_ = 0;
};

// Returns the position, 0 or 1, of a cube on `axis` in a block of 2 x 2 x 2 cubes. `index` is the
// cube's index in this block, 4x + 2y + z.
constexpr int64_t axis_bit(size_t index, size_t axis) {
  return static_cast<int64_t>(index >> (2 - axis) & 1);
}

}  // namespace

// Returns the word offset of a cube of the input whose edge is the edge of the new grid. `index` is
// the cube's position, in units of this edge. Returns kNoNode if the cube is empty or outside the
// input's grid.
uint64_t MovedLevels::cube_at(const std::array<int64_t, 3>& index) const {
  const int64_t depth = std::max<int64_t>(input_level(0), 0);
  for (const int64_t i : index)
    if (i < 0 || i >= int64_t{1} << depth) return kNoNode;
  uint64_t cube = input_.file().empty() ? kNoNode : 0;
  for (int64_t level = 0; level < depth && cube != kNoNode; ++level) {
    size_t child = 0;
    for (const int64_t i : index)
      child = 2 * child + static_cast<size_t>(i >> (depth - 1 - level) & 1);
    cube = children_by_index(input_.node(static_cast<uint32_t>(level), cube))[child];
  }
  return cube;
}

MovedLevels::Cubes MovedLevels::root() const {
  Cubes cubes;
  for (size_t i = 0; i < 8; ++i) {
    std::array<int64_t, 3> index;
    bool is_used = true;
    for (size_t axis = 0; axis < 3; ++axis) {
      index[axis] = (-offset_[axis] >> levels_) + axis_bit(i, axis);
      is_used = is_used && (axis_bit(i, axis) == 0 || remainder(0, axis) != 0);
    }
    cubes[i] = is_used ? cube_at(index) : kNoNode;
  }
  return cubes;
}

// Returns the children of a cube of the input. `level` is the level of the new file with cubes of
// the same edge.
std::array<uint64_t, 8> MovedLevels::children(uint32_t level, uint64_t cube) const {
  std::array<uint64_t, 8> children;
  children.fill(kNoNode);
  if (cube == kNoNode) return children;
  const int64_t at = input_level(level);
  if (at >= 0) return children_by_index(input_.node(static_cast<uint32_t>(at), cube));
  children[0] = 0;  // the input's grid is in the low corner of this cube
  return children;
}

void MovedLevels::add(Open& to, const Cubes& cubes, uint64_t place) const {
  for (const uint64_t cube : cubes)
    if (cube != kNoNode) return to.requests->add({cubes, place});
}

// Sorts the requests of a level to find its distinct groups (moved.h), and numbers these groups.
// Stores the number of the group for each place (result_rows.h) that requests it.
void MovedLevels::number_groups(Open& level) const {
  SpillSorter<Request>& requests = *level.requests;
  requests.finish();
  requests.begin();
  while (!requests.at_end()) {
    const Cubes cubes = requests.front().cubes;
    const uint64_t number = level.groups->size();
    level.groups->add(cubes);
    for (; !requests.at_end() && requests.front().cubes == cubes; requests.pop())
      level.result->uses.add({number, requests.front().place});
  }
  level.requests.reset();
  level.groups->finish();
  level.result->uses.finish();
}

void MovedLevels::expand_groups(const Open& level, Open& below) const {
  // On each axis, the first child of the new cube begins in the first (0) or in the second (1)
  // child of the group's first cube. It begins in the second child if remainder() is at least the
  // child's edge.
  std::array<int64_t, 3> first;
  for (size_t axis = 0; axis < 3; ++axis)
    first[axis] = remainder(level.level, axis) >= edge(below.level) ? 1 : 0;
  uint64_t number = 0;
  for (SpillReader group(*level.groups); !group.at_end(); group.pop(), ++number) {
    std::array<uint64_t, 8> finer[8];
    for (size_t i = 0; i < 8; ++i) finer[i] = children(level.level, group.front()[i]);
    for (size_t child = 0; child < 8; ++child) {
      Cubes cubes;
      for (size_t i = 0; i < 8; ++i) {
        size_t cube = 0, octant = 0;
        bool is_used = true;
        for (size_t axis = 0; axis < 3; ++axis) {
          const int64_t at = axis_bit(child, axis) + first[axis] + axis_bit(i, axis);
          is_used = is_used && (axis_bit(i, axis) == 0 || remainder(below.level, axis) != 0);
          cube = 2 * cube + static_cast<size_t>(at >> 1 & 1);
          octant = 2 * octant + static_cast<size_t>(at & 1);
        }
        cubes[i] = is_used ? finer[cube][octant] : kNoNode;
      }
      add(below, cubes, place_of(number, static_cast<int>(child)));
    }
  }
}

// Returns the mask of a new brick, whose voxels are in the up to 2 x 2 x 2 input bricks of its
// group.
uint64_t MovedLevels::brick(const Cubes& cubes) const {
  uint64_t masks[8], mask = 0;
  for (size_t i = 0; i < 8; ++i) masks[i] = cubes[i] == kNoNode ? 0 : input_.brick(cubes[i]);
  const auto within_brick = [&](size_t axis) { return static_cast<int>(-offset_[axis] & 3); };
  const int rx = within_brick(0), ry = within_brick(1), rz = within_brick(2);
  for (int x = 0; x < kBrickEdge; ++x)
    for (int y = 0; y < kBrickEdge; ++y)
      for (int z = 0; z < kBrickEdge; ++z) {
        const int fx = x + rx, fy = y + ry, fz = z + rz;
        const auto from = static_cast<size_t>(4 * (fx >> 2) + 2 * (fy >> 2) + (fz >> 2));
        const uint64_t bit = masks[from] >> brick_bit(fx & 3, fy & 3, fz & 3) & 1;
        mask |= bit << brick_bit(x, y, z);
      }
  return mask;
}

void MovedLevels::add_bricks(const Open& level, BrickResults& bricks) const {
  uint64_t number = 0;
  for (SpillReader group(*level.groups); !group.at_end(); group.pop(), ++number) {
    const uint64_t mask = brick(group.front());
    if (mask == 0) continue;
    bricks.rows.add({brick_row(mask, hash_bits_), number});
    bricks.counts.add({number, {0, static_cast<uint64_t>(popcount64(mask))}});
  }
  bricks.counts.finish();
}

std::vector<std::unique_ptr<PairLevel>> MovedLevels::descend(BrickResults& bricks) {
  std::vector<std::unique_ptr<PairLevel>> levels;
  Open open(0, space_);
  add(open, root(), 0);
  for (;;) {
    number_groups(open);
    if (open.level + 2 == levels_) break;
    Open below(open.level + 1, space_);
    expand_groups(open, below);
    levels.push_back(std::move(open.result));
    open = std::move(below);
  }
  add_bricks(open, bricks);
  levels.push_back(std::move(open.result));
  return levels;
}

bool has_voxels_outside(const voxdag_reader::File& file, const std::array<int64_t, 3>& offset,
                        int64_t resolution) {
  return OutsideSearch(file, offset, resolution).find();
}

}  // namespace voxdag::query
