#include "core/format/global/diff.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <compare>
#include <cstdio>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/host_device.h"
#include "core/base/page_buffer.h"
#include "core/base/parallel_for.h"
#include "core/dag/node_hash.h"
#include "core/format/global/open_global.h"

namespace voxdag {
namespace {

constexpr uint64_t kAbsent = ~uint64_t{0};

// Two nodes on the same level, one of each file, given by their word offsets. An offset is kAbsent
// if the file has no node at this place of the octree.
struct NodePair {
  uint64_t a = kAbsent, b = kAbsent;
  friend auto operator<=>(const NodePair&, const NodePair&) = default;
  uint64_t hash() const { return hash_brick(hash_brick(a) ^ b); }
};

DiffReport operator+(const DiffReport& a, const DiffReport& b) {
  return {a.only_a + b.only_a, a.only_b + b.only_b};
}

// The pairs of nodes that were compared, with their results. A hash table with open addressing, at
// most 3/4 full.
class PairTable {
 public:
  explicit PairTable(MemoryBudget& budget) : budget_(&budget) { grow(64); }

  std::optional<DiffReport> find(const NodePair& pair, uint64_t hash) const {
    const Entry& entry = entries_[find_entry(pair, hash)];
    return entry.taken() ? std::optional(entry.report) : std::nullopt;
  }
  void insert(const NodePair& pair, uint64_t hash, const DiffReport& report) {
    if (4 * (count_ + 1) > 3 * entries_.size()) grow(2 * entries_.size());
    Entry& entry = entries_[find_entry(pair, hash)];
    count_ += !entry.taken();
    entry = {pair.a + 1, pair.b + 1, report};
  }

 private:
  // Each offset is stored plus one. So 0 stands for kAbsent, and zeroed memory is a free entry.
  struct Entry {
    uint64_t a1 = 0, b1 = 0;
    DiffReport report;
    bool taken() const { return a1 != 0 || b1 != 0; }
    NodePair pair() const { return {a1 - 1, b1 - 1}; }
  };

  // Returns the index of the pair's entry or, if the table does not contain the pair, of the free
  // entry for it.
  size_t find_entry(const NodePair& pair, uint64_t hash) const {
    size_t at = hash & (entries_.size() - 1);
    while (entries_[at].taken() && entries_[at].pair() != pair)
      at = (at + 1) & (entries_.size() - 1);
    return at;
  }
  void grow(size_t size) {
    PageBuffer<Entry> old(*budget_, size, "pairs of nodes");
    std::swap(old, entries_);
    for (const Entry& entry : old)
      if (entry.taken()) entries_[find_entry(entry.pair(), entry.pair().hash())] = entry;
  }

  MemoryBudget* budget_;
  PageBuffer<Entry> entries_;
  size_t count_ = 0;
};

// The compared pairs of one level, for all threads. The table is divided into parts with separate
// locks.
class SharedPairTable {
 public:
  explicit SharedPairTable(MemoryBudget& budget) {
    for (size_t i = 0; i < kParts; ++i) parts_.push_back(std::make_unique<Part>(budget));
  }
  std::optional<DiffReport> find(const NodePair& pair) const {
    const uint64_t hash = pair.hash();
    const Part& part = part_of(hash);
    const std::lock_guard lock(part.mutex);
    return part.table.find(pair, hash);
  }
  void insert(const NodePair& pair, const DiffReport& report) {
    const uint64_t hash = pair.hash();
    Part& part = part_of(hash);
    const std::lock_guard lock(part.mutex);
    part.table.insert(pair, hash, report);
  }

 private:
  static constexpr size_t kParts = 64;
  struct Part {
    explicit Part(MemoryBudget& budget) : table(budget) {}
    mutable std::mutex mutex;
    PairTable table;
  };
  // Returns the part for a hash, selected by the high bits of the hash. The table of a part uses
  // the low bits.
  Part& part_of(uint64_t hash) const { return *parts_[hash >> 58]; }

  std::vector<std::unique_ptr<Part>> parts_;
};

class Differ {
 public:
  Differ(const voxdag_reader::File& a, const voxdag_reader::File& b, unsigned threads,
         MemoryBudget& budget, const CancelToken& cancel)
      : a_(a), b_(b), threads_(threads), cancel_(cancel) {
    for (uint32_t level = 0; level < a.brick_level(); ++level) compared_.emplace_back(budget);
  }

  // Finds a level with enough pairs. Divides these pairs among the threads; each thread compares
  // the subtrees of its pairs. The levels above only add up the results.
  DiffReport run() {
    std::vector<NodePair> pairs{{a_.empty() ? kAbsent : 0, b_.empty() ? kAbsent : 0}};
    const NodePair root = pairs[0];
    uint32_t level = 0;
    for (; level < a_.brick_level() && pairs.size() < kPairsToDivide; ++level)
      pairs = pairs_below(level, pairs);
    parallel_for(threads_, pairs.size(), [&](unsigned, size_t i) { compare(level, pairs[i]); });
    return compare(0, root);
  }

 private:
  // The first level with at least this many pairs, or else the level of the bricks, is divided
  // among the threads. This many pairs are enough for any number of threads. The choice of the
  // level does not depend on the number of threads, so the error that is reported does not depend
  // on it either.
  static constexpr size_t kPairsToDivide = 16384;

  // Returns the pairs of children, by child index. Both offsets of a pair are kAbsent if neither
  // node has this child.
  std::array<NodePair, 8> children_of(uint32_t level, const NodePair& pair) const {
    const voxdag_reader::Node a = node(a_, level, pair.a), b = node(b_, level, pair.b);
    std::array<NodePair, 8> below;
    for (int index = 0; index < 8; ++index)
      below[static_cast<size_t>(index)] = {child(a, index), child(b, index)};
    return below;
  }

  // Returns the pairs of children of all `pairs`. Each pair occurs once.
  std::vector<NodePair> pairs_below(uint32_t level, const std::vector<NodePair>& pairs) const {
    std::vector<NodePair> below;
    for (const NodePair& pair : pairs)
      for (const NodePair& children : children_of(level, pair)) below.push_back(children);
    std::ranges::sort(below);
    below.erase(std::unique(below.begin(), below.end()), below.end());
    return below;
  }

  DiffReport compare(uint32_t level, const NodePair& pair) {
    if (pair == NodePair()) return {};
    if (level == a_.brick_level()) return compare_bricks(pair);
    if (const auto known = compared_[level].find(pair)) return *known;
    cancel_.check();
    DiffReport total;
    const std::array<NodePair, 8> below = children_of(level, pair);
    for (const NodePair& children : below) prefetch(level + 1, children);
    for (const NodePair& children : below) total = total + compare(level + 1, children);
    compared_[level].insert(pair, total);
    return total;
  }

  // Prefetches the words of both nodes, so that the cache misses of a node's children overlap.
  VOXDAG_PREFETCH void prefetch(uint32_t level, const NodePair& pair) const {
    if (pair.a < a_.level(level).word_count) __builtin_prefetch(a_.level(level).words + pair.a);
    if (pair.b < b_.level(level).word_count) __builtin_prefetch(b_.level(level).words + pair.b);
  }

  DiffReport compare_bricks(const NodePair& pair) const {
    const uint64_t mask_a = pair.a == kAbsent ? 0 : a_.brick(pair.a);
    const uint64_t mask_b = pair.b == kAbsent ? 0 : b_.brick(pair.b);
    return {static_cast<uint64_t>(popcount64(mask_a & ~mask_b)),
            static_cast<uint64_t>(popcount64(mask_b & ~mask_a))};
  }

  static voxdag_reader::Node node(const voxdag_reader::File& file, uint32_t level,
                                  uint64_t offset) {
    return offset == kAbsent ? voxdag_reader::Node() : file.node(level, offset);
  }
  static uint64_t child(const voxdag_reader::Node& node, int index) {
    if (!(node.child_mask >> index & 1)) return kAbsent;
    // In a damaged file a pointer can equal kAbsent. Such a pointer must not count as an absent
    // child.
    return std::min(voxdag_reader::File::child(node, index), kAbsent - 1);
  }

  const voxdag_reader::File &a_, &b_;
  const unsigned threads_;
  const CancelToken& cancel_;
  std::vector<SharedPairTable> compared_;  // one table per level
};

bool same_words(const voxdag_reader::Level& a, const voxdag_reader::Level& b, unsigned threads,
                const CancelToken& cancel) {
  constexpr uint64_t kWordsPerItem = uint64_t{1} << 20;
  if (a.word_count != b.word_count || a.pointer_bits != b.pointer_bits) return false;
  std::atomic<bool> same = true;
  parallel_for(threads, (a.word_count + kWordsPerItem - 1) / kWordsPerItem,
               [&](unsigned, size_t item) {
                 if (!same) return;
                 cancel.check();
                 const uint64_t first = item * kWordsPerItem;
                 const uint64_t end = std::min(first + kWordsPerItem, a.word_count);
                 if (!std::equal(a.words + first, a.words + end, b.words + first)) same = false;
               });
  return same;
}

// True if all levels of the two files have equal words. Then the files have equal voxels. Files
// with equal voxels, hash bits and node order always have equal words.
bool same_words(const voxdag_reader::File& a, const voxdag_reader::File& b, unsigned threads,
                const CancelToken& cancel) {
  for (uint32_t l = 0; l <= a.brick_level(); ++l)
    if (!same_words(a.level(l), b.level(l), threads, cancel)) return false;
  return true;
}

std::string grid_text(const voxdag_reader::File& file) {
  char text[160];
  std::snprintf(text, sizeof(text), "%lld voxels, origin %.17g %.17g %.17g, edge %.17g",
                static_cast<long long>(file.resolution()), file.origin()[0], file.origin()[1],
                file.origin()[2], file.edge());
  return text;
}

}  // namespace

void expect_same_grid(const voxdag_reader::File& a, const voxdag_reader::File& b,
                      const std::string& what) {
  if (a.resolution() != b.resolution() || a.edge() != b.edge() ||
      !std::equal(a.origin(), a.origin() + 3, b.origin()))
    throw Error(ErrorCode::kInvalidInput, "only files of the same grid can be " + what + ": " +
                                              a.path() + " has " + grid_text(a) + "; " + b.path() +
                                              " has " + grid_text(b));
}

DiffReport diff_global_files(const voxdag_reader::File& a, const voxdag_reader::File& b,
                             unsigned threads, MemoryBudget& budget, const CancelToken& cancel) {
  expect_same_grid(a, b, "compared");
  if (same_words(a, b, threads, cancel)) return {};
  return with_reader_errors([&] { return Differ(a, b, threads, budget, cancel).run(); });
}

}  // namespace voxdag
