#include "query/morphology/neighbor_levels.h"

#include <algorithm>
#include <utility>

#include "core/base/host_device.h"
#include "query/morphology/brick_window.h"

namespace voxdag::query {
namespace {

bool has_cube(const std::array<uint64_t, 8>& cubes) {
  return std::ranges::any_of(cubes, [](uint64_t cube) { return cube != kNoNode; });
}

// Returns the position, 0 or 1, of a cube on `axis` in a block of 2 x 2 x 2 cubes. `index` is the
// cube's index in this block, 4x + 2y + z.
constexpr int axis_bit(size_t index, int axis) { return static_cast<int>(index >> (2 - axis) & 1); }

}  // namespace

NeighborLevels::NeighborLevels(DagInput& input, const MorphologyStep& step, const SpillSpace& space)
    : input_(input), levels_(input.file().grid_levels()), step_(step), space_(space) {
  find_full_nodes();
  find_sources();
}

void NeighborLevels::find_full_nodes() {
  full_.assign(levels_ - 1, kNoNode);
  for (uint32_t level = levels_ - 1; level-- > 0;) {
    const auto is_full = [&](const LevelCursor& cursor) {
      if (is_brick_level(level)) return cursor.brick() == ~uint64_t{0};
      const auto children = children_by_index(cursor.node());
      return std::ranges::all_of(children,
                                 [&](uint64_t child) { return child == full_[level + 1]; });
    };
    for (LevelCursor cursor(input_, level); !cursor.at_end(); cursor.next())
      if (is_full(cursor)) full_[level] = cursor.offset();
    if (full_[level] == kNoNode) return;  // then no coarser cube is full
  }
}

void NeighborLevels::find_sources() {
  const int towards_neighbor = step_.is_upward ? 1 : -1;
  for (const bool is_adjacent : {false, true})
    for (size_t child = 0; child < 8; ++child)
      for (size_t i = 0; i < 8; ++i) {
        size_t cube = 0, octant = 0;
        for (int axis = 0; axis < 3; ++axis) {
          const int own = axis_bit(child, axis), is_neighbor = axis_bit(i, axis);
          // If the neighbor of the child is adjacent, it can be in the same cube as the child.
          const int at = is_adjacent && is_neighbor ? own + towards_neighbor : own;
          const bool is_outside = is_adjacent ? at < 0 || at > 1 : is_neighbor != 0;
          cube = 2 * cube + (is_outside ? 1 : 0);
          octant = 2 * octant + static_cast<size_t>(at & 1);
        }
        sources_[is_adjacent][child][i] = {static_cast<uint8_t>(cube),
                                           static_cast<uint8_t>(octant)};
      }
}

// Replaces a group for which is_exact() is true by a group with the same result: sorts the cubes,
// and removes repetitions and cubes that do not change the result. Returns false if the result is
// empty.
bool NeighborLevels::make_exact(uint32_t level, Cubes& cubes) const {
  const uint64_t full = full_[level];
  const auto is_present = [&](uint64_t cube) {
    return std::ranges::find(cubes, cube) != cubes.end();
  };
  uint64_t ignored = kNoNode;
  if (step_.is_erosion) {
    if (is_present(kNoNode)) return false;
    if (full != kNoNode) ignored = full;
  } else if (full != kNoNode && is_present(full)) {
    cubes.fill(full);
    return true;
  }
  auto end = std::remove_if(cubes.begin(), cubes.end(),
                            [&](uint64_t cube) { return cube == ignored || cube == kOutside; });
  if (end == cubes.begin()) {
    cubes.fill(ignored);
    return ignored != kNoNode;
  }
  std::sort(cubes.begin(), end);
  end = std::unique(cubes.begin(), end);
  std::fill(end, cubes.end(), cubes[0]);
  return true;
}

// Replaces a group by the group that stands for all groups that have the same result for a reason
// in the header. Returns false if the result is empty.
bool NeighborLevels::normalize(uint32_t level, Cubes& cubes) const {
  if (is_exact(level)) return make_exact(level, cubes);
  if (step_.is_erosion) return cubes[0] != kNoNode;
  if (full_[level] != kNoNode && cubes[0] == full_[level]) cubes.fill(cubes[0]);
  return has_cube(cubes);
}

void NeighborLevels::add(Open& to, Cubes cubes, uint64_t place) const {
  if (!normalize(to.level, cubes)) return;
  if (!is_brick_level(to.level)) return to.requests.add({cubes, place});
  const uint64_t mask = brick(cubes);
  if (mask != 0) to.bricks.add({mask, place});
}

// Sorts the requests of a level to find their distinct contents, which are groups or bricks, and
// calls visit(content, number) for each. Stores the number for each place (result_rows.h) that
// requests the content.
template <class Content, class Visit>
void NeighborLevels::number(SpillSorter<Request<Content>>& requests, PairLevel& result,
                            const Visit& visit) const {
  requests.finish();
  requests.begin();
  for (uint64_t number = 0; !requests.at_end(); ++number) {
    const Content content = requests.front().content;
    for (; !requests.at_end() && requests.front().content == content; requests.pop())
      result.uses.add({number, requests.front().place});
    visit(content, number);
  }
  result.uses.finish();
}

void NeighborLevels::expand_groups(Open& level, Open& below) {
  const auto& sources = sources_[is_adjacent(below.level)];
  number(level.requests, *level.result, [&](const Cubes& group, uint64_t number) {
    ++group_count_;
    std::array<uint64_t, 8> finer[8];
    for (size_t i = 0; i < 8; ++i) {
      if (group[i] == kNoNode || group[i] == kOutside)
        finer[i].fill(group[i]);
      else
        finer[i] = children_by_index(input_.node(level.level, group[i]));
    }
    for (size_t child = 0; child < 8; ++child) {
      Cubes cubes;
      for (size_t i = 0; i < 8; ++i) {
        const Source& source = sources[child][i];
        cubes[i] = finer[source.cube][source.child];
      }
      add(below, cubes, place_of(number, static_cast<int>(child)));
    }
  });
}

// Returns the mask of a new brick. `cubes` are bricks of the file.
uint64_t NeighborLevels::brick(const Cubes& cubes) const {
  std::array<uint64_t, 8> masks;
  for (size_t i = 0; i < 8; ++i) {
    const bool is_repeated = i > 0 && cubes[i] == cubes[i - 1];
    masks[i] = is_repeated            ? masks[i - 1]
               : cubes[i] == kNoNode  ? 0
               : cubes[i] == kOutside ? ~uint64_t{0}
                                      : input_.brick(cubes[i]);
  }
  if (!step_.is_window) {
    uint64_t result = masks[0];
    for (const uint64_t mask : masks) result = step_.is_erosion ? result & mask : result | mask;
    return result;
  }
  const int own = step_.is_upward ? 0 : kBrickEdge, neighbor = kBrickEdge - own;
  const auto at = [&](size_t i, int axis) { return axis_bit(i, axis) ? neighbor : own; };
  BrickWindow window;
  for (size_t i = 0; i < 8; ++i)
    if (masks[i] != 0) window.add(masks[i], at(i, 0), at(i, 1), at(i, 2));
  window.apply(step_.is_erosion, step_.is_upward, step_.distance);
  return window.brick(own);
}

void NeighborLevels::add_bricks(Open& level, BrickResults& bricks) const {
  number(level.bricks, *level.result, [&](uint64_t mask, uint64_t number) {
    bricks.rows.add({brick_row(mask, input_.file().hash_bits()), number});
    bricks.counts.add({number, {0, static_cast<uint64_t>(popcount64(mask))}});
  });
  bricks.counts.finish();
}

std::vector<std::unique_ptr<PairLevel>> NeighborLevels::descend(BrickResults& bricks,
                                                                Progress& progress) {
  std::vector<std::unique_ptr<PairLevel>> levels;
  auto open = std::make_unique<Open>(0, space_);
  Cubes root;
  root.fill(outside());
  root[0] = kNoNode;
  if (!input_.file().empty()) root[0] = 0;
  add(*open, root, 0);
  while (!is_brick_level(open->level)) {
    auto below = std::make_unique<Open>(open->level + 1, space_);
    expand_groups(*open, *below);
    levels.push_back(std::move(open->result));
    open = std::move(below);
    progress.advance(1);
  }
  add_bricks(*open, bricks);
  levels.push_back(std::move(open->result));
  progress.advance(1);
  return levels;
}

}  // namespace voxdag::query
