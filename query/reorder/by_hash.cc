#include "query/reorder/by_hash.h"

#include <memory>
#include <optional>
#include <utility>

#include "core/base/popcount8.h"
#include "query/combine/result_rows.h"
#include "query/combine/spill/node_values.h"

namespace voxdag::query {
namespace {

// A node or brick of a level: its row (result_rows.h) with the offsets of its children in the
// output file, and its own word offset in the input file.
struct OldRow {
  Row row;
  uint64_t offset = 0;
  friend bool operator<(const OldRow& a, const OldRow& b) { return compare_rows(a.row, b.row) < 0; }
};

// The position of a node in the output file, and its word offset in the input file.
struct PlacedNode {
  uint64_t offset = 0;
  NewNode node;
  friend bool operator<(const PlacedNode& a, const PlacedNode& b) { return a.offset < b.offset; }
};

using NewNodes = NodeValues<NewNode>;

// Makes the rows of all nodes of a level. `below` has the new positions and the hashes of the nodes
// on the next finer level; it is null if the level has bricks.
class RowMaker {
 public:
  RowMaker(DagInput& input, uint32_t level, const NewNodes* below, const SpillSpace& space,
           uint64_t window_bytes)
      : input_(input), level_(level) {
    if (below) lookups_.emplace(*below, space, window_bytes);
    if (below && lookups_->needs_announcement()) announce();
  }

  void add_rows(SpillSorter<OldRow>& rows) {
    const uint32_t hash_bits = input_.file().hash_bits();
    for (LevelCursor nodes(input_, level_); !nodes.at_end(); nodes.next())
      rows.add({lookups_ ? node_row(nodes) : brick_row(nodes.brick(), hash_bits), nodes.offset()});
  }

 private:
  void announce() {
    for (LevelCursor nodes(input_, level_); !nodes.at_end(); nodes.next())
      for (int i = 0; i < kPopcount8[nodes.node().child_mask]; ++i)
        lookups_->announce(nodes.node().child(i));
    lookups_->resolve();
  }
  Row node_row(const LevelCursor& nodes) {
    const voxdag_reader::Node& node = nodes.node();
    lookups_->visit(nodes);
    Row row;
    row.mask = node.child_mask;
    row.count = kPopcount8[node.child_mask];
    uint64_t hashes[8];
    for (uint32_t i = 0; i < row.count; ++i) {
      const FoundValue<NewNode> child = lookups_->next(node.child(static_cast<int>(i)));
      if (!child.begins)
        input_.corrupt(level_, nodes.offset(),
                       "a child pointer leads to a word at which no node begins: expected a node");
      hashes[i] = child.value.hash;
      row.children[i] = child.value.position;
    }
    row.hash = truncate_hash(hash_node(row.mask, static_cast<int>(row.count), hashes),
                             input_.file().hash_bits());
    return row;
  }

  DagInput& input_;
  const uint32_t level_;
  std::optional<NodeLookups<NewNodes>> lookups_;
};

// Sorts the rows and writes them as a level. Adds the new position of each node to `placed`.
// Returns the number of words of the level.
uint64_t write_rows(DagInput& input, uint32_t level, SpillSorter<OldRow>& rows, bool is_wide,
                    GlobalFileWriter& out, MemoryBudget& budget, SpillSorter<PlacedNode>& placed) {
  rows.finish();
  out.begin_level(level);
  RowWriter writer(out, is_wide, budget);
  Row previous;
  for (rows.begin(); !rows.at_end(); rows.pop()) {
    const OldRow& next = rows.front();
    if (writer.nodes() > 0 && compare_rows(previous, next.row) == 0)
      input.corrupt(level, next.offset,
                    "the node is equal to another node: expected no equal nodes");
    previous = next.row;
    placed.add({next.offset, {writer.add(next.row), next.row.hash}});
  }
  writer.flush();
  out.end_level({.nodes = writer.nodes(), .words = writer.words()});
  return writer.words();
}

}  // namespace

void write_levels_by_hash(DagInput& input, const SpillSpace& space, const OffsetMemory& memory,
                          GlobalFileWriter& out, Progress& progress) {
  std::unique_ptr<NewNodes> below;
  uint64_t words_below = 0;
  for (uint32_t level = input.file().brick_level() + 1; level-- > 0;) {
    SpillSorter<PlacedNode> placed(space);
    {
      SpillSorter<OldRow> rows(space);
      RowMaker(input, level, below.get(), space, memory.window_bytes).add_rows(rows);
      words_below =
          write_rows(input, level, rows, out.is_wide(words_below), out, space.budget, placed);
    }
    below = std::make_unique<NewNodes>(space, input.level(level), memory.value_bytes);
    placed.finish();
    for (placed.begin(); !placed.at_end(); placed.pop())
      below->add(placed.front().offset, placed.front().node);
    below->finish();
    progress.advance(input.level(level).node_count);
  }
}

}  // namespace voxdag::query
