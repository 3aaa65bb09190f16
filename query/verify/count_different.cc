#include "query/verify/count_different.h"

#include <algorithm>
#include <bit>
#include <compare>
#include <memory>
#include <optional>

#include "core/base/error.h"
#include "core/base/host_device.h"
#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/base/process_limits.h"
#include "core/dag/node_hash.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/verify_checksums.h"
#include "core/io/outputs/temporary_work.h"
#include "query/combine/operation.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {
namespace {

// Divisors of the memory limit: the quotients are the memory of a sorter and of the RecentPairs. At
// any time, there are two sorters: one for the current level, and one for the next.
constexpr uint64_t kSorterShare = 16;
constexpr uint64_t kRecentShare = 8;
constexpr uint64_t kListBufferBytes = uint64_t{64} << 10;

// A pair of cubes of the same level that occurs at `places` places of the grid.
struct CountedPair {
  NodePair cubes;
  uint64_t places = 0;
  friend bool operator<(const CountedPair& a, const CountedPair& b) { return a.cubes < b.cubes; }
};

// Joins equal pairs before they are sorted. Each slot of the table has the last pair with its hash.
class RecentPairs {
 public:
  RecentPairs(uint64_t bytes, MemoryBudget& budget)
      : slots_(budget, std::bit_floor(std::max<uint64_t>(bytes / sizeof(CountedPair), 1)),
               "recent pairs of nodes") {}

  void add(const CountedPair& pair, SpillSorter<CountedPair>& to) {
    const uint64_t hash = hash_brick(hash_brick(pair.cubes.a) ^ pair.cubes.b);
    CountedPair& slot = slots_[hash & (slots_.size() - 1)];
    if (slot.places != 0 && slot.cubes == pair.cubes) {
      slot.places += pair.places;
      return;
    }
    if (slot.places != 0) to.add(slot);
    slot = pair;
  }
  void flush(SpillSorter<CountedPair>& to) {
    for (CountedPair& slot : slots_) {
      if (slot.places != 0) to.add(slot);
      slot.places = 0;
    }
  }

 private:
  PageBuffer<CountedPair> slots_;
};

class LevelCounts {
 public:
  LevelCounts(const voxdag_reader::File& a, const voxdag_reader::File& b,
              const CountDifferentSpec& spec, FileSystem& files, const CancelToken& cancel)
      : a_(a, spec.memory_bytes, cancel),
        b_(b, spec.memory_bytes, cancel),
        budget_(spec.memory_bytes),
        folder_(files, spec.work_prefix),
        scratch_(files, folder_.path()),
        space_{scratch_, budget_, 0, share(spec, kSorterShare),
               std::min(spec.list_bytes, kListBufferBytes)},
        recent_(share(spec, kRecentShare), budget_) {}

  CountDifferentReport run(Progress& progress) {
    const uint32_t bricks = a_.file().brick_level();
    progress.begin_stage("compare", bricks + 2, "levels");
    DiffReport total;
    if (!have_equal_words()) {
      progress.advance(1);
      auto pairs = std::make_unique<SpillSorter<CountedPair>>(space_);
      add({{root(a_), root(b_)}, 1}, *pairs);
      for (uint32_t level = 0; level < bricks; ++level) {
        auto below = std::make_unique<SpillSorter<CountedPair>>(space_);
        visit_pairs(*pairs, [&](const CountedPair& pair) { divide(level, pair, *below); });
        pairs = std::move(below);
        progress.advance(1);
      }
      visit_pairs(*pairs, [&](const CountedPair& pair) { add_bricks(pair, total); });
      progress.advance(1);
    }
    progress.end_stage();
    return {total, scratch_.bytes_written()};
  }

 private:
  static uint64_t share(const CountDifferentSpec& spec, uint64_t divisor) {
    return std::min(spec.memory_bytes / divisor, spec.list_bytes);
  }
  static uint64_t root(const DagInput& input) { return input.file().empty() ? kNoNode : 0; }

  // True if all levels of the two files have equal words. Then the files have equal voxels.
  bool have_equal_words() {
    constexpr uint64_t kChunkWords = uint64_t{1} << 20;
    for (uint32_t level = 0; level <= a_.file().brick_level(); ++level) {
      const uint64_t words = a_.level(level).word_count;
      if (words != b_.level(level).word_count ||
          a_.level(level).pointer_bits != b_.level(level).pointer_bits)
        return false;
      for (uint64_t first = 0; first < words; first += kChunkWords) {
        const uint64_t count = std::min(kChunkWords, words - first);
        if (!std::ranges::equal(a_.words(level, first, count), b_.words(level, first, count)))
          return false;
      }
    }
    return true;
  }

  void add(const CountedPair& pair, SpillSorter<CountedPair>& to) {
    if (pair.cubes != NodePair()) recent_.add(pair, to);
  }

  // Completes `pairs`, and calls visit() for each distinct pair, in sorted order.
  template <class Visit>
  void visit_pairs(SpillSorter<CountedPair>& pairs, const Visit& visit) {
    recent_.flush(pairs);
    pairs.finish();
    for (pairs.begin(); !pairs.at_end();) {
      CountedPair pair = pairs.front();
      for (pairs.pop(); !pairs.at_end() && pairs.front().cubes == pair.cubes; pairs.pop())
        pair.places += pairs.front().places;
      visit(pair);
    }
  }

  static std::array<uint64_t, 8> children(DagInput& input, uint32_t level, uint64_t offset) {
    return children_by_index(offset == kNoNode ? voxdag_reader::Node() : input.node(level, offset));
  }
  void divide(uint32_t level, const CountedPair& pair, SpillSorter<CountedPair>& below) {
    const auto a = children(a_, level, pair.cubes.a), b = children(b_, level, pair.cubes.b);
    for (size_t c = 0; c < 8; ++c) add({{a[c], b[c]}, pair.places}, below);
  }

  static uint64_t brick(DagInput& input, uint64_t offset) {
    return offset == kNoNode ? 0 : input.brick(offset);
  }
  void add_bricks(const CountedPair& pair, DiffReport& total) {
    const uint64_t a = brick(a_, pair.cubes.a), b = brick(b_, pair.cubes.b);
    total.only_a += pair.places * static_cast<uint64_t>(popcount64(a & ~b));
    total.only_b += pair.places * static_cast<uint64_t>(popcount64(b & ~a));
  }

  DagInput a_, b_;
  MemoryBudget budget_;
  const TemporaryWork folder_;
  ScratchFolder scratch_;
  const SpillSpace space_;
  RecentPairs recent_;
};

// Compares in memory. Returns nullopt if the memory is not sufficient.
std::optional<DiffReport> count_in_memory(const voxdag_reader::File& a,
                                          const voxdag_reader::File& b,
                                          const CountDifferentSpec& spec, Progress& progress,
                                          const CancelToken& cancel) {
  const uint64_t file_bytes = a.file_bytes() + b.file_bytes();
  if (file_bytes >= spec.memory_bytes) return std::nullopt;
  MemoryBudget budget(std::min(spec.memory_bytes - file_bytes, spec.list_bytes));
  std::optional<DiffReport> report;
  progress.begin_stage("compare", 0, "pairs of nodes");
  try {
    report = diff_global_files(a, b, spec.threads, budget, cancel);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
  }
  progress.end_stage();
  return report;
}

}  // namespace

CountDifferentReport count_different(const voxdag_reader::File& a, const voxdag_reader::File& b,
                                     const CountDifferentSpec& spec, FileSystem& files,
                                     Progress& progress, const CancelToken& cancel) {
  expect_same_grid(a, b, "compared");
  for (const voxdag_reader::File* file : {&a, &b}) {
    PageLimit pages(*file, spec.memory_bytes);
    verify_checksums(*file, spec.threads, pages, progress, cancel);
    if (resident_bytes() > spec.memory_bytes / 2) file->release_pages();
  }
  if (const auto report = count_in_memory(a, b, spec, progress, cancel)) return {*report, 0};
  return with_reader_errors([&] { return LevelCounts(a, b, spec, files, cancel).run(progress); });
}

}  // namespace voxdag::query
