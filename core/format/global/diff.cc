#include "core/format/global/diff.h"

#include <algorithm>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/host_device.h"
#include "core/base/page_buffer.h"
#include "core/dag/node_hash.h"
#include "core/format/global/open_global.h"

namespace voxdag {
namespace {

constexpr uint64_t kAbsent = ~uint64_t{0};

// The pairs of nodes of one level that were compared, with their results. Open addressing, at most
// 3/4 full.
class PairTable {
 public:
  explicit PairTable(MemoryBudget& budget) : budget_(&budget) { grow(64); }

  const DiffReport* find(uint64_t a, uint64_t b) const {
    const Entry& entry = entries_[find_entry(a, b)];
    return entry.taken() ? &entry.report : nullptr;
  }
  void insert(uint64_t a, uint64_t b, const DiffReport& report) {
    if (4 * (count_ + 1) > 3 * entries_.size()) grow(2 * entries_.size());
    entries_[find_entry(a, b)] = {a + 1, b + 1, report};
    ++count_;
  }

 private:
  // Offsets are stored plus one, so that absent is 0 and zeroed pages are free entries.
  struct Entry {
    uint64_t a1 = 0, b1 = 0;
    DiffReport report;
    bool taken() const { return a1 != 0 || b1 != 0; }
  };

  // Index of the entry that has the pair, or of the free one where it belongs.
  size_t find_entry(uint64_t a, uint64_t b) const {
    const uint64_t a1 = a + 1, b1 = b + 1;
    size_t at = hash_brick(hash_brick(a1) ^ b1) & (entries_.size() - 1);
    while (entries_[at].taken() && (entries_[at].a1 != a1 || entries_[at].b1 != b1))
      at = (at + 1) & (entries_.size() - 1);
    return at;
  }
  void grow(size_t size) {
    PageBuffer<Entry> old(*budget_, size, "pairs of nodes");
    std::swap(old, entries_);
    for (const Entry& entry : old)
      if (entry.taken()) entries_[find_entry(entry.a1 - 1, entry.b1 - 1)] = entry;
  }

  MemoryBudget* budget_;
  PageBuffer<Entry> entries_;
  size_t count_ = 0;
};

class Differ {
 public:
  Differ(const voxdag_reader::File& a, const voxdag_reader::File& b, MemoryBudget& budget,
         const CancelToken& cancel)
      : a_(a), b_(b), cancel_(cancel) {
    for (uint32_t level = 0; level < a.brick_level(); ++level) compared_.emplace_back(budget);
  }
  DiffReport run() { return compare(0, a_.empty() ? kAbsent : 0, b_.empty() ? kAbsent : 0); }

 private:
  DiffReport compare(uint32_t level, uint64_t a, uint64_t b) {
    if (a == kAbsent && b == kAbsent) return {};
    if (level == a_.brick_level()) return compare_bricks(a, b);
    if (const DiffReport* known = compared_[level].find(a, b)) return *known;
    cancel_.check();
    const voxdag_reader::Node node_a = node(a_, level, a), node_b = node(b_, level, b);
    DiffReport total;
    for (int index = 0; index < 8; ++index) {
      const DiffReport part = compare(level + 1, child(node_a, index), child(node_b, index));
      total.only_a += part.only_a;
      total.only_b += part.only_b;
    }
    compared_[level].insert(a, b, total);
    return total;
  }

  DiffReport compare_bricks(uint64_t a, uint64_t b) const {
    const uint64_t mask_a = a == kAbsent ? 0 : a_.brick(a), mask_b = b == kAbsent ? 0 : b_.brick(b);
    return {static_cast<uint64_t>(popcount64(mask_a & ~mask_b)),
            static_cast<uint64_t>(popcount64(mask_b & ~mask_a))};
  }

  static voxdag_reader::Node node(const voxdag_reader::File& file, uint32_t level,
                                  uint64_t offset) {
    return offset == kAbsent ? voxdag_reader::Node() : file.node(level, offset);
  }
  static uint64_t child(const voxdag_reader::Node& node, int index) {
    return node.child_mask >> index & 1 ? voxdag_reader::File::child(node, index) : kAbsent;
  }

  const voxdag_reader::File &a_, &b_;
  const CancelToken& cancel_;
  std::vector<PairTable> compared_;  // by level
};

// Equal words mean equal voxels. Files of the same voxels and hash bits have equal words.
bool same_words(const voxdag_reader::File& a, const voxdag_reader::File& b) {
  for (uint32_t l = 0; l <= a.brick_level(); ++l) {
    const voxdag_reader::Level &in_a = a.level(l), &in_b = b.level(l);
    if (in_a.word_count != in_b.word_count || in_a.pointer_bits != in_b.pointer_bits ||
        !std::equal(in_a.words, in_a.words + in_a.word_count, in_b.words))
      return false;
  }
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

DiffReport diff_global_files(const voxdag_reader::File& a, const voxdag_reader::File& b,
                             MemoryBudget& budget, const CancelToken& cancel) {
  if (a.resolution() != b.resolution() || a.edge() != b.edge() ||
      !std::equal(a.origin(), a.origin() + 3, b.origin()))
    throw Error(ErrorCode::kInvalidInput,
                "only files of the same grid can be compared: " + a.path() + " has " +
                    grid_text(a) + "; " + b.path() + " has " + grid_text(b));
  if (same_words(a, b)) return {};
  return with_reader_errors([&] { return Differ(a, b, budget, cancel).run(); });
}

}  // namespace voxdag
