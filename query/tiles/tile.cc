#include "query/tiles/tile.h"

#include <bit>
#include <string>

#include "core/base/error.h"
#include "core/dag/brick.h"
#include "query/tiles/node_checks.h"
#include "query/tiles/offset_table.h"

namespace voxdag::query {
namespace {

constexpr size_t kHeaderWords = 4;
constexpr uint32_t kLeavesAreBricks = 1u << 16;

void check_address(const DagView& dag, const TileAddress& root, const CheckedBlocks* blocks) {
  const bool has_level = !dag.empty() && root.level < dag.grid_levels() - kBrickLevels;
  const auto is_node = [&] {
    NodeChecks(dag, root.level, blocks).expect_intact(root.offset);
    const auto& [words, wide] = dag.level(root.level);
    return root.offset < words.size() && words[root.offset] - 1 < 255;
  };
  if (!has_level)
    throw Error(ErrorCode::kNotFound,
                "level " + std::to_string(root.level) + " has no tiles: expected a level below " +
                    std::to_string(dag.empty() ? 0 : dag.grid_levels() - kBrickLevels) +
                    ", the number of levels with nodes");
  if (!is_node())
    throw Error(ErrorCode::kNotFound, "level " + std::to_string(root.level) + ", word " +
                                          std::to_string(root.offset) +
                                          ": no node begins here, expected the offset of a node "
                                          "from the manifest or from a tile");
}

// Appends the nodes of a level to `words`. Each appended node has the numbers of its children in
// `children` instead of their offsets. A child without a number gets the next number. Returns the
// word index at which each node begins, counted from the end of the tile's header.
std::vector<uint32_t> add_nodes(const DagView& dag, const CheckedBlocks* blocks, uint32_t level,
                                const std::vector<uint64_t>& offsets, OffsetTable& children,
                                std::vector<uint32_t>& words) {
  const NodeChecks checks(dag, level, blocks);
  std::vector<uint32_t> starts;
  starts.reserve(offsets.size());
  for (const uint64_t offset : offsets) dag.prefetch(level, offset);
  for (const uint64_t offset : offsets) {
    checks.expect_intact(offset);
    const DagView::Children c = dag.children_of_node(level, offset);
    starts.push_back(static_cast<uint32_t>(words.size() - kHeaderWords));
    words.push_back(c.mask);
    for (int i = 0; i < 8; ++i)
      if (c.has(i)) words.push_back(children.add(dag.offset(c, i)));
  }
  return starts;
}

// In the nodes from word `begin` to word `end`, replaces the number of each child by the child's
// word index, child_starts[number].
void point_to(const std::vector<uint32_t>& child_starts, size_t begin, size_t end,
              std::vector<uint32_t>& words) {
  while (begin < end) {
    const int children = std::popcount(words[begin++]);
    for (int i = 0; i < children; ++i, ++begin) words[begin] = child_starts[words[begin]];
  }
}

void add_64(uint64_t value, std::vector<uint32_t>& words) {
  words.push_back(static_cast<uint32_t>(value));
  words.push_back(static_cast<uint32_t>(value >> 32));
}

void add_bricks(const DagView& dag, const CheckedBlocks* blocks,
                const std::vector<uint64_t>& offsets, std::vector<uint32_t>& words) {
  const uint32_t level = dag.grid_levels() - kBrickLevels;
  const NodeChecks checks(dag, level, blocks);
  for (const uint64_t offset : offsets) dag.prefetch(level, offset);
  for (const uint64_t offset : offsets) {
    checks.expect_intact(offset);
    if (offset % 2 != 0) dag.corrupt(level, offset);
    add_64(dag.brick(offset), words);
  }
}

// Appends the offset and the coarse brick of each node at which the tile ends. The nodes from which
// coarse bricks are made are scattered over the file. So each of the loops prefetches the words
// that the next loop reads.
void add_cut_off(const DagView& dag, const CheckedBlocks* blocks, uint32_t level,
                 const std::vector<uint64_t>& offsets, std::vector<uint32_t>& words) {
  const NodeChecks checks(dag, level, blocks), child_checks(dag, level + 1, blocks);
  std::vector<DagView::Children> nodes;
  nodes.reserve(offsets.size());
  for (const uint64_t offset : offsets) dag.prefetch(level, offset);
  for (const uint64_t offset : offsets) {
    checks.expect_intact(offset);
    nodes.push_back(dag.children_of_node(level, offset));
    for (int i = 0; i < 8; ++i)
      if (nodes.back().has(i)) {
        const uint64_t child = dag.offset(nodes.back(), i);
        dag.prefetch(level + 1, child);
        child_checks.expect_intact(child);
      }
  }
  for (size_t i = 0; i < offsets.size(); ++i) {
    add_64(offsets[i], words);
    add_64(brick_of_cells(dag, level, nodes[i]), words);
  }
}

}  // namespace

uint32_t tile_end(uint32_t grid_levels, uint32_t tile_levels, uint32_t level) {
  const uint32_t below = grid_levels - kBrickLevels - level;  // number of levels below `level`
  return level + (below - 1) % tile_levels + 1;
}

std::vector<uint32_t> encode_tile(const DagView& dag, uint32_t tile_levels, const TileAddress& root,
                                  const CheckedBlocks* blocks) {
  if (tile_levels < 1 || tile_levels > kMaxTileLevels)
    throw Error(ErrorCode::kInvalidInput, std::to_string(tile_levels) +
                                              " levels in a tile: expected 1 to " +
                                              std::to_string(kMaxTileLevels));
  check_address(dag, root, blocks);
  const uint32_t end = tile_end(dag.grid_levels(), tile_levels, root.level);
  const bool has_bricks = end + kBrickLevels == dag.grid_levels();
  std::vector<uint32_t> words(kHeaderWords);
  OffsetTable nodes;
  nodes.add(root.offset);
  size_t parents = kHeaderWords;  // index of the first word of the nodes of the level above
  for (uint32_t level = root.level; level < end; ++level) {
    OffsetTable children;
    const size_t begin = words.size();
    const auto starts = add_nodes(dag, blocks, level, nodes.offsets(), children, words);
    if (level > root.level) point_to(starts, parents, begin, words);
    parents = begin;
    nodes = std::move(children);
  }
  words[0] = kTileMagic;
  words[1] = root.level | (end - root.level) << 8 | (has_bricks ? kLeavesAreBricks : 0);
  words[2] = static_cast<uint32_t>(words.size() - kHeaderWords);
  words[3] = static_cast<uint32_t>(nodes.offsets().size());
  if (has_bricks)
    add_bricks(dag, blocks, nodes.offsets(), words);
  else
    add_cut_off(dag, blocks, end, nodes.offsets(), words);
  return words;
}

}  // namespace voxdag::query
