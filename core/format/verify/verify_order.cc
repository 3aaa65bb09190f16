#include "core/format/verify/verify_order.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/base/popcount8.h"
#include "core/format/verify/span_file.h"

namespace voxdag {
namespace {

// Limits of the average bytes of the HashedNodes in a range of hashes.
constexpr uint64_t kMinRangeBytes = uint64_t{64} << 10;
constexpr uint64_t kMaxRangeBytes = uint64_t{64} << 20;
constexpr std::string_view kSortBuffer = "hashes of a level";

struct HashedNode {
  uint64_t hash = 0;
  uint64_t at = 0;  // word offset at which it begins
};

std::string place_in(const voxdag_reader::File& file, uint32_t level, uint64_t word) {
  return file.path() + ": level " + std::to_string(level) + ", word " + std::to_string(word) + ": ";
}

// Compares the nodes with hashes in one range.
void expect_unique_range(const VerifyTask& task, uint32_t level, std::span<HashedNode> nodes) {
  const auto are_equal = [&](const HashedNode& a, const HashedNode& b) {
    return a.hash == b.hash && !is_node_less(task.file, level, a.at, b.at) &&
           !is_node_less(task.file, level, b.at, a.at);
  };
  std::sort(nodes.begin(), nodes.end(), [&](const HashedNode& a, const HashedNode& b) {
    if (a.hash != b.hash) return a.hash < b.hash;
    if (is_node_less(task.file, level, a.at, b.at)) return true;
    return a.at < b.at && !is_node_less(task.file, level, b.at, a.at);
  });
  const auto equal = std::adjacent_find(nodes.begin(), nodes.end(), are_equal);
  if (equal != nodes.end())
    throw Error(ErrorCode::kCorrupt, place_in(task.file, level, equal[1].at) +
                                         "the node is equal to the node at word " +
                                         std::to_string(equal[0].at) + ": expected no equal nodes");
}

// Returns the range of a hash if there are 2^`bits` ranges.
uint64_t range_of(uint64_t hash, int bits) { return bits == 0 ? 0 : hash >> (64 - bits); }

void expect_unique_in_memory(const VerifyTask& task, const CheckedLevel& nodes, int bits) {
  std::vector<uint64_t> counts(uint64_t{1} << bits);
  for (uint64_t i = 0; i < nodes.table.size(); ++i) ++counts[range_of(nodes.table.hash(i), bits)];
  parallel_for(task.threads, counts.size(), [&](unsigned, size_t range) {
    PageBuffer<HashedNode> sorted(task.budget, counts[range], kSortBuffer);
    uint64_t filled = 0;
    for (uint64_t span = 0; span < nodes.index.span_count(); ++span) {
      task.cancel.check();
      nodes.index.visit_span(span, [&](uint64_t i, uint64_t at) {
        const uint64_t hash = nodes.table.hash(i);
        if (range_of(hash, bits) == range) sorted[filled++] = {hash, at};
      });
    }
    expect_unique_range(task, nodes.level, {sorted.data(), sorted.size()});
  });
}

// Writes the hashes to lists, one list for each range, then sorts one range on each thread.
void expect_unique_stored(const VerifyTask& task, const CheckedLevel& nodes, unsigned threads,
                          int bits) {
  const uint64_t spans = nodes.span_count(), ranges = uint64_t{1} << bits;
  task.scratch->require_space(nodes.spans.level().node_count * sizeof(HashedNode),
                              task.file.path() + ": level " + std::to_string(nodes.level));
  SpanLists lists(*task.scratch, task.budget, spans, ranges, sizeof(HashedNode) / sizeof(uint32_t));
  std::vector<std::atomic<uint64_t>> counts(ranges);
  std::vector<SpanLists::Buffer> buffers(threads);
  std::vector<SubtreeTable> tables(threads);
  for (SubtreeTable& table : tables)
    table = SubtreeTable(task.budget, nodes.spans.span_words() / 2 + 1, nodes.cube_levels);
  parallel_for(threads, spans, [&](unsigned worker, size_t span) {
    task.cancel.check();
    const uint64_t first = nodes.spans.nodes_before(span);
    SubtreeTable& table = tables[worker];
    nodes.values->read(span, table.words_of(0, nodes.spans.nodes_before(span + 1) - first));
    lists.write(span, buffers[worker], [&](const auto& add) {
      nodes.visit_span(span, [&](uint64_t i, uint64_t at) {
        const HashedNode node{table.hash(i - first), at};
        uint32_t words[sizeof(HashedNode) / sizeof(uint32_t)];
        std::memcpy(words, &node, sizeof(node));
        add(range_of(node.hash, bits), words);
      });
    });
    for (uint64_t range = 0; range < ranges; ++range)
      counts[range] += lists.items(buffers[worker], range);
    task.pages.touch(sizeof(uint32_t) * nodes.spans.span_words());
  });
  std::vector<PageBuffer<HashedNode>> sorted(threads);
  for (uint64_t first = 0; first < ranges; first += threads) {
    const uint64_t count = std::min<uint64_t>(threads, ranges - first);
    for (uint64_t i = 0; i < count; ++i) {
      sorted[i] = {};
      sorted[i] = PageBuffer<HashedNode>(task.budget, counts[first + i], kSortBuffer);
      std::atomic<uint64_t> filled = 0;
      parallel_for(threads, spans, [&](unsigned worker, size_t span) {
        task.cancel.check();
        const auto words = lists.next(span, first + i, buffers[worker]);
        const uint64_t added = words.size_bytes() / sizeof(HashedNode);
        const uint64_t at = filled.fetch_add(added);
        if (at + added > sorted[i].size()) lists.damaged(span);
        if (!words.empty())
          std::memcpy(static_cast<void*>(&sorted[i][at]), words.data(), words.size_bytes());
      });
    }
    task.pages.check();
    parallel_for(threads, count, [&](unsigned, size_t i) {
      expect_unique_range(task, nodes.level, {sorted[i].data(), sorted[i].size()});
    });
  }
}

}  // namespace

bool is_node_less(const voxdag_reader::File& file, uint32_t level, uint64_t a, uint64_t b) {
  if (level == file.brick_level()) return file.brick(a) < file.brick(b);
  const voxdag_reader::Node left = verified_node(file, level, a);
  const voxdag_reader::Node right = verified_node(file, level, b);
  if (left.child_mask != right.child_mask) return left.child_mask < right.child_mask;
  for (int c = 0; c < popcount8(left.child_mask); ++c)
    if (left.child(c) != right.child(c)) return left.child(c) < right.child(c);
  return false;
}

void expect_first_parents(const VerifyTask& task, const CheckedLevel& nodes) {
  const voxdag_reader::File& file = task.file;
  const uint32_t level = nodes.level;
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
    // Only if the file has changed, a pointer can lead to the end of the level here.
    if (child < next || child >= file.level(level + 1).word_count) return;
    const auto children = [&] {
      const voxdag_reader::Node below = verified_node(file, level + 1, next);
      return static_cast<uint64_t>(popcount8(below.child_mask)) << below.wide;
    };
    next += has_bricks ? 2 : 1 + children();
  };
  for (uint64_t span = 0; span < nodes.span_count(); ++span) {
    task.cancel.check();
    const uint64_t first = next;
    nodes.visit_span(span, [&](uint64_t, uint64_t at) {
      const voxdag_reader::Node node = verified_node(file, level, at);
      for (int c = 0; c < popcount8(node.child_mask); ++c) pass(at, node, c);
    });
    task.pages.touch(sizeof(uint32_t) * (NodeIndex::kSpanWords + next - first));
  }
}

void expect_unique(const VerifyTask& task, const CheckedLevel& nodes) {
  const unsigned threads = nodes.is_stored() ? task.threads_for_scratch() : task.threads;
  const uint64_t range_bytes =
      std::clamp(task.free_memory() / 4 / threads, kMinRangeBytes, kMaxRangeBytes);
  const uint64_t bytes = task.file.level(nodes.level).node_count * sizeof(HashedNode);
  const int bits = std::bit_width((bytes - 1) / range_bytes);
  if (nodes.is_stored())
    expect_unique_stored(task, nodes, threads, bits);
  else
    expect_unique_in_memory(task, nodes, bits);
}

}  // namespace voxdag
