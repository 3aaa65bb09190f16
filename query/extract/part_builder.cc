#include "query/extract/part_builder.h"

#include <algorithm>
#include <utility>

#include "core/base/popcount8.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kNodesBetweenChecks = 4096;  // between two checks of the cancel token
// For n nodes of a level, memory for kExpectedChildren * n nodes is reserved in the next finer
// level. Nodes of surfaces have four children on average, but often share them.
constexpr uint64_t kExpectedChildren = 2;
constexpr uint64_t kPrefetchAhead = 8;  // distance of prefetches, in nodes

// Returns the occupied octants of a brick: bit c is set if byte c of the brick's `mask` is not 0.
uint8_t coarser_cells(uint64_t mask) {
  uint8_t cells = 0;
  for (int c = 0; c < 8; ++c)
    if (mask >> (8 * c) & 255) cells = static_cast<uint8_t>(cells | 1u << c);
  return cells;
}

void append(PooledMemory& memory, PooledArray<uint32_t>& all, uint64_t& count, uint32_t child) {
  if (count == UINT32_MAX) throw OutOfBudget{};
  if (count == all.size()) all.grow(memory, count + 1024);
  all[count++] = child;
}

}  // namespace

std::array<int64_t, 3> PartBuilder::corner(uint32_t level,
                                           const PartLevel::Position& position) const {
  return {position[0] * edge(level), position[1] * edge(level), position[2] * edge(level)};
}

std::vector<SelectedPart> PartBuilder::split(const SelectedPart& part) {
  const voxdag_reader::Node node = reader_.node(part.cube.level, part.offset);
  std::vector<SelectedPart> children;
  int next = 0;
  for (int c = 0; c < 8; ++c) {
    if (!(node.child_mask >> c & 1)) continue;
    const SelectedPart child{part.cube.child(c), node.child(next++)};
    const auto& p = child.cube.position;
    if (selection_.region.intersects(corner(child.cube.level, {p[0], p[1], p[2]}),
                                     edge(child.cube.level)))
      children.push_back(child);
  }
  return children;
}

template <class Visit>
void PartBuilder::read(uint32_t level, PartLevel& nodes, PartLevel& below, Children& children,
                       Visit visit) {
  const PartLevel::Sorted sorted = nodes.sort();
  children.masks = PooledArray<uint8_t>(memory_, nodes.size());
  children.first = PooledArray<uint32_t>(memory_, nodes.size());
  below.reserve(std::min(kExpectedChildren * nodes.size(), file_.level(level + 1).node_count));
  const int wide = file_.level(level + 1).pointer_bits == 64;
  const auto prefetch = [&](std::span<const uint32_t> words) {
    const size_t end = std::min(words.size(), size_t{1} + (kPopcount8[words[0] & 255] << wide));
    for (size_t i = 1; i < end; i += size_t{1} << wide) below.prefetch(words[i]);
  };
  reader_.for_each(level, sorted.span(), prefetch,
                   [&](const WantedNode& wanted, std::span<const uint32_t> words) {
                     children.first[wanted.index] = static_cast<uint32_t>(children.count);
                     visit(wanted.index, reader_.parse_node(level, wanted.offset, words));
                   });
}

// Reads the nodes of a level above the bricks of the selected grid, and adds their children that
// intersect the selection's region to `below`.
void PartBuilder::read_nodes(uint32_t level, PartLevel& nodes, PartLevel& below,
                             Children& children) {
  const int64_t child_edge = edge(level + 1);
  const auto add = [&](uint32_t number) { append(memory_, children.all, children.count, number); };
  read(level, nodes, below, children, [&](uint64_t index, const voxdag_reader::Node& node) {
    if (!nodes.is_cut(index)) {
      children.masks[index] = static_cast<uint8_t>(node.child_mask);
      for (int n = 0; n < kPopcount8[node.child_mask]; ++n) add(below.find_or_add(node.child(n)));
      return;
    }
    const PartLevel::Position at = nodes.position(index);
    uint32_t mask = 0;
    int next = 0;
    for (int c = 0; c < 8; ++c) {
      if (!(node.child_mask >> c & 1)) continue;
      const uint64_t offset = node.child(next++);
      const PartLevel::Position child{2 * at[0] + static_cast<uint32_t>(child_coordinate(c, 0)),
                                      2 * at[1] + static_cast<uint32_t>(child_coordinate(c, 1)),
                                      2 * at[2] + static_cast<uint32_t>(child_coordinate(c, 2))};
      const auto low = corner(level + 1, child);
      if (!selection_.region.intersects(low, child_edge)) continue;
      mask |= 1u << c;
      add(selection_.region.contains(low, child_edge) ? below.find_or_add(offset)
                                                      : below.add_cut(offset, child));
    }
    children.masks[index] = static_cast<uint8_t>(mask);
  });
  nodes.release_entries();
}

// Reads the file's nodes from which bricks of a coarser grid are made, and adds all their children
// to `below`. build_bricks() removes cells outside the region later.
void PartBuilder::read_all_children(uint32_t level, PartLevel& nodes, PartLevel& below,
                                    Children& children) {
  read(level, nodes, below, children, [&](uint64_t index, const voxdag_reader::Node& node) {
    children.masks[index] = static_cast<uint8_t>(node.child_mask);
    for (int n = 0; n < kPopcount8[node.child_mask]; ++n)
      append(memory_, children.all, children.count, below.find_or_add(node.child(n)));
  });
}

uint8_t PartBuilder::cells_of_brick(uint64_t mask) const {
  return majority_ ? MajorityCells::octants(mask) : coarser_cells(mask);
}

uint8_t PartBuilder::cells_of_node(const voxdag_reader::Node& node) const {
  return majority_ ? majority_->children(node) : static_cast<uint8_t>(node.child_mask);
}

// Reads the file's nodes or bricks that are one level above the cells of the selected grid.
// Returns, by node number, the mask of the octants that are set cells.
PooledArray<uint8_t> PartBuilder::read_cells(PartLevel& nodes) {
  const uint32_t level = brick_level() + 1;
  const PartLevel::Sorted sorted = nodes.sort();
  PooledArray<uint8_t> cells(memory_, nodes.size());
  const bool bricks = level == file_.brick_level();
  reader_.for_each(
      level, sorted.span(), [&](const WantedNode& wanted, std::span<const uint32_t> words) {
        cells[wanted.index] = bricks
                                  ? cells_of_brick(reader_.parse_brick(wanted.offset, words))
                                  : cells_of_node(reader_.parse_node(level, wanted.offset, words));
      });
  return cells;
}

// Returns the masks of the bricks of the selected grid. build_bricks() later removes their cells
// outside the region.
PooledArray<uint64_t> PartBuilder::read_bricks(PartLevel& bricks) {
  PooledArray<uint64_t> masks(memory_, bricks.size());
  if (selection_.grid_levels == file_.grid_levels()) {
    const PartLevel::Sorted sorted = bricks.sort();
    reader_.for_each(brick_level(), sorted.span(),
                     [&](const WantedNode& wanted, std::span<const uint32_t> words) {
                       masks[wanted.index] = reader_.parse_brick(wanted.offset, words);
                     });
    return masks;
  }
  PartLevel below = level_of_part(brick_level() + 1);
  Children children;
  read_all_children(brick_level(), bricks, below, children);
  const PooledArray<uint8_t> cells = read_cells(below);
  for (uint64_t i = 0; i < bricks.size(); ++i) {
    uint64_t mask = 0, next = children.first[i];
    for (int c = 0; c < 8; ++c)
      if (children.masks[i] >> c & 1)
        mask |= static_cast<uint64_t>(cells[children.all[next++]]) << (8 * c);
    masks[i] = mask;
  }
  return masks;
}

uint64_t PartBuilder::selected_bits(const PartLevel::Position& brick) const {
  const auto low = corner(brick_level(), brick);
  uint64_t bits = 0;
  for (int bit = 0; bit < 64; ++bit)
    if (selection_.region.contains(
            {low[0] + brick_coordinate(bit, 0), low[1] + brick_coordinate(bit, 1),
             low[2] + brick_coordinate(bit, 2)},
            1))
      bits |= uint64_t{1} << bit;
  return bits;
}

PooledArray<PartBuilder::Built> PartBuilder::build_bricks(PartLevel& bricks, SubDagTables& tables) {
  const PooledArray<uint64_t> masks = read_bricks(bricks);
  PooledArray<Built> built(memory_, bricks.size());
  for (uint64_t i = 0; i < bricks.size(); ++i) {
    if (i % kNodesBetweenChecks == 0) cancel_.check();
    const uint64_t mask =
        bricks.is_cut(i) ? masks[i] & selected_bits(bricks.position(i)) : masks[i];
    built[i] = {tables.add_brick(mask), {mask != 0, static_cast<uint64_t>(popcount64(mask))}};
  }
  return built;
}

PooledArray<PartBuilder::Built> PartBuilder::build_nodes(uint32_t level, uint64_t count,
                                                         const Children& children,
                                                         const PooledArray<Built>& below,
                                                         SubDagTables& tables) {
  PooledArray<Built> built(memory_, count);
  const int size_log2 = static_cast<int>(selection_.grid_levels - level);
  for (uint64_t i = 0; i < count; ++i) {
    if (i % kNodesBetweenChecks == 0) cancel_.check();
    if (i + 2 * kPrefetchAhead < count)
      __builtin_prefetch(&children.all[children.first[i + 2 * kPrefetchAhead]]);
    if (i + kPrefetchAhead < count) {
      const uint64_t ahead = i + kPrefetchAhead;
      for (int n = 0; n < kPopcount8[children.masks[ahead]]; ++n)
        __builtin_prefetch(&below[children.all[children.first[ahead] + n]]);
    }
    NodeRef refs[8];
    OctreeCounts counts;
    uint64_t next = children.first[i];
    for (int c = 0; c < 8; ++c) {
      if (!(children.masks[i] >> c & 1)) continue;
      const Built& child = below[children.all[next++]];
      refs[c] = child.ref;
      counts += child.counts;
    }
    const NodeRef ref = tables.add_node(size_log2, refs);
    counts.nodes += ref.exists;
    built[i] = {ref, counts};
  }
  return built;
}

SubDagSummary PartBuilder::build(const SelectedPart& part, const SubDagShape& shape,
                                 SubDagSink& sink) {
  const uint32_t top = part.cube.level, bricks = brick_level();
  std::vector<PartLevel> levels;
  for (uint32_t l = top; l <= bricks; ++l) levels.push_back(level_of_part(l));
  std::vector<Children> children(bricks - top);
  const PartLevel::Position at{part.cube.position[0], part.cube.position[1], part.cube.position[2]};
  if (selection_.region.contains(corner(top, at), edge(top)))
    levels[0].find_or_add(part.offset);
  else
    levels[0].add_cut(part.offset, at);
  for (uint32_t l = top; l < bricks; ++l)
    read_nodes(l, levels[l - top], levels[l - top + 1], children[l - top]);
  SubDagTables tables(memory_, static_cast<int>(selection_.grid_levels - top));
  PooledArray<Built> built = build_bricks(levels.back(), tables);
  levels.back().release_entries();
  for (uint32_t l = bricks; l-- > top;) {
    built = build_nodes(l, levels[l - top].size(), children[l - top], built, tables);
    children[l - top] = {};
  }
  // Replaces the tables' counts by the sums that build_nodes() has computed. The tables count a
  // node when it is added, so they count a node with several parents only once.
  tables.counts() = built[0].counts;
  built = {};
  return emit_levels(tables, shape, sink);
}

}  // namespace voxdag::query
