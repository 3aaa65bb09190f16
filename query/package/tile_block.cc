#include "query/package/tile_block.h"

#include <bit>
#include <cstring>

#include "core/base/error.h"
#include "core/dag/brick.h"
#include "query/tiles/tile.h"

namespace voxdag::query {
namespace {

constexpr size_t kTileHeadWords = 4;

[[noreturn]] void refuse_block(const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "a block of tiles is damaged: " + what);
}

void set_bit(std::string& bits, size_t index) {
  bits.resize(std::max(bits.size(), index / 8 + 1), '\0');
  bits[index / 8] = static_cast<char>(bits[index / 8] | 1 << index % 8);
}

// Reads the columns of a block one after the other. Throws Error{kCorrupt} after the end of the
// block.
class Columns {
 public:
  explicit Columns(std::string_view bytes) : left_(bytes) {}

  std::string_view take(size_t count) {
    if (count > left_.size()) refuse_block("it ends too early, expected all columns");
    const std::string_view column = left_.substr(0, count);
    left_.remove_prefix(count);
    return column;
  }
  uint8_t take_byte() { return static_cast<uint8_t>(take(1).front()); }
  uint32_t take_word() {
    uint32_t word;
    std::memcpy(&word, take(sizeof word).data(), sizeof word);
    return word;
  }
  // Reads the mask of a leaf.
  uint64_t take_mask() {
    uint64_t mask = 0;
    for (uint32_t left = take_byte(); left != 0; left &= left - 1) {
      const uint64_t byte = take_byte();
      if (byte == 0) refuse_block("a stored byte of a leaf is 0, expected another value");
      mask |= byte << 8 * std::countr_zero(left);
    }
    return mask;
  }
  void expect_end() const {
    if (!left_.empty()) refuse_block("bytes follow after the last column, expected none");
  }

 private:
  std::string_view left_;
};

// A leaf of a tile: the mask of a brick; or, for a cut-off node (a node above the bricks at which
// the tile ends), its coarse brick and the number of the tile that begins there.
struct Leaf {
  uint64_t mask = 0;
  uint32_t number = 0;
  bool operator==(const Leaf&) const = default;
};

// A node of a tile while TileBuilder shares equal nodes: its child mask, and the index of each
// child in the list of distinct nodes of the next level, or of distinct leaves.
struct ExpandedNode {
  uint32_t mask = 0;
  std::vector<uint32_t> children;
  bool operator==(const ExpandedNode&) const = default;
};

// Returns the index of `item` in the list. Adds the item to the list if it is new.
template <class Item>
uint32_t index_in(std::vector<Item>& items, const Item& item) {
  for (size_t i = 0; i < items.size(); ++i)
    if (items[i] == item) return static_cast<uint32_t>(i);
  items.push_back(item);
  return static_cast<uint32_t>(items.size() - 1);
}

// Makes the words of a tile from its expanded form, in which no node or leaf is shared: the child
// masks of each level, and the leaves. Shares all equal nodes, from the leaves up. This restores
// the original tile, because equal nodes of a canonical DAG are one node.
class TileBuilder {
 public:
  TileBuilder(uint32_t level, uint32_t levels, bool bricks)
      : level_(level), levels_(levels), bricks_(bricks) {}

  std::vector<uint32_t> build(const std::vector<std::string>& masks,
                              const std::vector<Leaf>& leaves) const {
    std::vector<Leaf> distinct_leaves;
    std::vector<uint32_t> children;  // for each child of the level above: index of the child
    for (const Leaf& leaf : leaves) children.push_back(index_in(distinct_leaves, leaf));
    std::vector<std::vector<ExpandedNode>> nodes(levels_);
    for (uint32_t level = levels_; level-- > 0;) {
      std::vector<uint32_t> indexes;
      size_t at = 0;
      for (const char mask : masks[level]) {
        ExpandedNode node{static_cast<unsigned char>(mask), {}};
        const auto count = static_cast<size_t>(std::popcount(node.mask));
        node.children.assign(children.begin() + static_cast<ptrdiff_t>(at),
                             children.begin() + static_cast<ptrdiff_t>(at + count));
        at += count;
        indexes.push_back(index_in(nodes[level], node));
      }
      children = std::move(indexes);
    }
    return words_of(nodes, distinct_leaves);
  }

 private:
  std::vector<uint32_t> words_of(const std::vector<std::vector<ExpandedNode>>& nodes,
                                 const std::vector<Leaf>& leaves) const {
    std::vector<std::vector<uint32_t>> starts(levels_);
    uint32_t at = 0;
    for (uint32_t level = 0; level < levels_; ++level)
      for (const ExpandedNode& node : nodes[level]) {
        starts[level].push_back(at);
        at += 1 + static_cast<uint32_t>(node.children.size());
      }
    std::vector<uint32_t> words = {kTileMagic, level_ | levels_ << 8 | uint32_t{bricks_} << 16, at,
                                   static_cast<uint32_t>(leaves.size())};
    for (uint32_t level = 0; level < levels_; ++level)
      for (const ExpandedNode& node : nodes[level]) {
        words.push_back(node.mask);
        for (const uint32_t child : node.children)
          words.push_back(level + 1 < levels_ ? starts[level + 1][child] : child);
      }
    for (const Leaf& leaf : leaves) {
      if (!bricks_) words.insert(words.end(), {leaf.number, 0});
      words.push_back(static_cast<uint32_t>(leaf.mask));
      words.push_back(static_cast<uint32_t>(leaf.mask >> 32));
    }
    return words;
  }

  const uint32_t level_, levels_;
  const bool bricks_;
};

size_t children_of(std::string_view masks) {
  size_t children = 0;
  for (const char mask : masks) {
    if (mask == 0) refuse_block("a node has no children, expected at least one");
    children += static_cast<size_t>(std::popcount(static_cast<unsigned char>(mask)));
  }
  return children;
}

// Reads the tile numbers of the leaves, which are cut-off nodes. `next` is the smallest tile number
// to which no earlier leaf refers. Each leaf that refers to this number increases it by 1.
void read_references(Columns& columns, std::vector<Leaf>& leaves, uint32_t& next) {
  const std::string_view is_old = columns.take((leaves.size() + 7) / 8);
  const auto old = [&](size_t i) { return is_old[i / 8] >> i % 8 & 1; };
  for (size_t i = leaves.size(); i < 8 * is_old.size(); ++i)
    if (old(i)) refuse_block("a reference follows after the last leaf, expected none");
  for (size_t i = 0; i < leaves.size(); ++i) {
    if (old(i)) {
      leaves[i].number = columns.take_word();
      if (leaves[i].number >= next)
        refuse_block("leaf " + std::to_string(i) + " refers to the tile " +
                     std::to_string(leaves[i].number) + ", expected a number below " +
                     std::to_string(next));
    } else {
      leaves[i].number = next++;
      if (next == 0) refuse_block("the numbers of its tiles exceed 32 bits, expected fewer tiles");
    }
  }
}

void append_word(std::string& bytes, uint32_t word) {
  bytes.append(reinterpret_cast<const char*>(&word), sizeof word);
}

}  // namespace

void TileBlockEncoder::add(const std::vector<uint32_t>& tile) {
  const uint32_t levels = tile[1] >> 8 & 255;
  std::vector<uint32_t> nodes = {0}, children;
  for (uint32_t level = 0; level < levels; ++level, nodes.swap(children)) {
    children.clear();
    for (const uint32_t node : nodes) {
      const uint32_t mask = tile[kTileHeadWords + node];
      masks_[level].push_back(static_cast<char>(mask));
      for (int child = 1; child <= std::popcount(mask); ++child)
        children.push_back(tile[kTileHeadWords + node + static_cast<uint32_t>(child)]);
    }
  }
  for (const uint32_t leaf : nodes) add_leaf(tile, leaf);
}

void TileBlockEncoder::add_leaf(const std::vector<uint32_t>& tile, size_t leaf) {
  const bool bricks = has_bricks(tile);
  const size_t at = leaves_begin(tile) + leaf * (bricks ? 2 : 4), mask = bricks ? at : at + 2;
  const size_t present = leaves_.size();
  leaves_.push_back(0);
  for (size_t byte = 0; byte < sizeof(uint64_t); ++byte) {
    const auto value = static_cast<char>(tile[mask + byte / 4] >> 8 * (byte % 4));
    if (value == 0) continue;
    leaves_[present] = static_cast<char>(leaves_[present] | 1 << byte);
    leaves_.push_back(value);
  }
  if (!bricks) {
    has_references_ = true;
    const uint32_t number = tile[at];
    if (number == next_) {
      ++next_;
    } else {
      set_bit(is_old_, leaf_count_);
      append_word(old_, number);
    }
  }
  ++leaf_count_;
}

std::string TileBlockEncoder::finish() const {
  std::string bytes;
  append_word(bytes, first_);
  for (const std::string& column : masks_) bytes += column;
  bytes += leaves_;
  if (!has_references_) return bytes;
  std::string bits = is_old_;
  bits.resize((leaf_count_ + 7) / 8, '\0');
  return bytes + bits + old_;
}

TileBlock decode_tile_block(std::string_view bytes, uint32_t grid_levels, uint32_t level,
                            uint32_t count) {
  const uint32_t end = tile_end(grid_levels, kPackageTileLevels, level), levels = end - level;
  const bool bricks = end + kBrickLevels == grid_levels;
  Columns columns(bytes);
  TileBlock block;
  block.first = block.next = columns.take_word();
  std::vector<std::string_view> masks;
  size_t nodes = count;
  for (uint32_t i = 0; i < levels; ++i) {
    masks.push_back(columns.take(nodes));
    nodes = children_of(masks.back());
  }
  std::vector<Leaf> leaves;
  for (size_t i = 0; i < nodes; ++i) {
    const uint64_t mask = columns.take_mask();
    if (mask == 0) refuse_block("a leaf has no cells, expected at least one");
    leaves.push_back({mask, 0});
  }
  if (!bricks) read_references(columns, leaves, block.next);
  columns.expect_end();
  const TileBuilder builder(level, levels, bricks);
  std::vector<size_t> at(levels + 1, 0);  // the tile's first node on each level, and first leaf
  for (uint32_t tile = 0; tile < count; ++tile) {
    std::vector<std::string> masks_of_tile;
    size_t width = 1;
    for (uint32_t i = 0; i < levels; ++i) {
      masks_of_tile.emplace_back(masks[i].substr(at[i], width));
      at[i] += width;
      width = children_of(masks_of_tile.back());
    }
    const auto first = leaves.begin() + static_cast<ptrdiff_t>(at[levels]);
    block.tiles.push_back(
        builder.build(masks_of_tile, {first, first + static_cast<ptrdiff_t>(width)}));
    at[levels] += width;
  }
  return block;
}

}  // namespace voxdag::query
