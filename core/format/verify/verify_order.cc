#include "core/format/verify/verify_order.h"

#include <algorithm>
#include <bit>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/base/popcount8.h"

namespace voxdag {
namespace {

// Maximum average number of nodes in a range of hashes. Their HashedNodes take 64 MiB.
constexpr uint64_t kNodesPerRange = uint64_t{1} << 22;

struct HashedNode {
  uint64_t hash = 0;
  uint64_t at = 0;  // word offset at which it begins
};

std::string place_in(const voxdag_reader::File& file, uint32_t level, uint64_t word) {
  return file.path() + ": level " + std::to_string(level) + ", word " + std::to_string(word) + ": ";
}

// Calls visit(hash, at) for each node whose hash has the value `range` in its `bits` highest bits.
// `at` is the word at which the node begins.
template <class Visit>
void visit_range(const HashedLevel& nodes, uint64_t range, int bits, const CancelToken& cancel,
                 const Visit& visit) {
  for (uint64_t span = 0; span < nodes.index.span_count(); ++span) {
    cancel.check();
    nodes.index.visit_span(span, [&](uint64_t i, uint64_t at) {
      const uint64_t hash = nodes.table.hash(i);
      if (bits == 0 || hash >> (64 - bits) == range) visit(hash, at);
    });
  }
}

void expect_unique_range(const HashedLevel& nodes, uint64_t range, int bits, uint64_t count,
                         MemoryBudget& budget, const CancelToken& cancel) {
  PageBuffer<HashedNode> sorted(budget, count, "hashes of a level");
  uint64_t filled = 0;
  visit_range(nodes, range, bits, cancel, [&](uint64_t hash, uint64_t at) {
    sorted[filled++] = {hash, at};
  });
  const auto is_less = [&](const HashedNode& a, const HashedNode& b) {
    return a.hash != b.hash ? a.hash < b.hash : is_node_less(nodes.file, nodes.level, a.at, b.at);
  };
  std::sort(sorted.begin(), sorted.end(), is_less);
  const HashedNode* const equal =
      std::adjacent_find(sorted.begin(), sorted.end(),
                         [&](const HashedNode& a, const HashedNode& b) { return !is_less(a, b); });
  if (equal != sorted.end())
    throw Error(ErrorCode::kCorrupt,
                place_in(nodes.file, nodes.level, std::max(equal[0].at, equal[1].at)) +
                    "the node is equal to the node at word " +
                    std::to_string(std::min(equal[0].at, equal[1].at)) +
                    ": expected no equal nodes");
}

}  // namespace

bool is_node_less(const voxdag_reader::File& file, uint32_t level, uint64_t a, uint64_t b) {
  if (level == file.brick_level()) return file.brick(a) < file.brick(b);
  const voxdag_reader::Node left = verified_node(file, level, a);
  const voxdag_reader::Node right = verified_node(file, level, b);
  if (left.child_mask != right.child_mask) return left.child_mask < right.child_mask;
  for (int c = 0; c < kPopcount8[left.child_mask]; ++c)
    if (left.child(c) != right.child(c)) return left.child(c) < right.child(c);
  return false;
}

void expect_first_parents(const voxdag_reader::File& file, uint32_t level, const NodeIndex& index,
                          const CancelToken& cancel, PageLimit& pages) {
  const bool has_bricks = level + 1 == file.brick_level();
  uint64_t next = 0;  // word of the first node that no pointer has referred to yet
  const auto pass = [&](uint64_t at, const voxdag_reader::Node& node, int c) {
    const uint64_t child = node.child(c);
    if (child > next)
      throw Error(ErrorCode::kCorrupt,
                  place_in(file, level, at + 1 + (static_cast<uint64_t>(c) << node.wide)) +
                      "the pointer leads to word " + std::to_string(child) +
                      ", but no pointer before it leads to the node at word " +
                      std::to_string(next) +
                      ": expected the order by first parent (docs/format.md)");
    if (child < next) return;
    const auto children = [&] {
      const voxdag_reader::Node below = verified_node(file, level + 1, next);
      return static_cast<uint64_t>(kPopcount8[below.child_mask]) << below.wide;
    };
    next += has_bricks ? 2 : 1 + children();
  };
  for (uint64_t span = 0; span < index.span_count(); ++span) {
    cancel.check();
    const uint64_t first = next;
    index.visit_span(span, [&](uint64_t, uint64_t at) {
      const voxdag_reader::Node node = verified_node(file, level, at);
      for (int c = 0; c < kPopcount8[node.child_mask]; ++c) pass(at, node, c);
    });
    pages.touch(sizeof(uint32_t) * (NodeIndex::kSpanWords + next - first));
  }
}

void expect_unique(const HashedLevel& nodes, unsigned threads, MemoryBudget& budget,
                   const CancelToken& cancel) {
  const uint64_t ranges = std::bit_ceil((nodes.table.size() + kNodesPerRange - 1) / kNodesPerRange);
  const int bits = std::countr_zero(ranges);
  std::vector<uint64_t> counts(ranges);
  for (uint64_t i = 0; i < nodes.table.size(); ++i)
    ++counts[bits == 0 ? 0 : nodes.table.hash(i) >> (64 - bits)];
  parallel_for(threads, ranges, [&](unsigned, size_t range) {
    expect_unique_range(nodes, range, bits, counts[range], budget, cancel);
  });
}

}  // namespace voxdag
