#include "merge/sort/level_merge.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "merge/fallback/cursor_merge.h"
#include "merge/fallback/group_stream.h"
#include "merge/sort/range_sweep.h"

namespace voxdag {
namespace {

// Rows of a range: what stays in a core's own cache while it is sorted; more runs get larger
// ranges, so that each run's share of a range is worth visiting.
constexpr uint64_t kRangeRows = 8192;
constexpr uint64_t kRangeRowsEachRun = 16;

// Walks the rows of one piece within one range.
class PieceCursor {
 public:
  PieceCursor(const Slab& slab, size_t piece, size_t range) : slab_(slab) {
    const SlabPiece& p = slab.pieces()[piece];
    row_ = p.row_base + slab.bound(range, piece).row;
    end_ = p.row_base + slab.bound(range + 1, piece).row;
    word_ = p.word_base + slab.bound(range, piece).word;
  }
  bool at_end() const { return row_ == end_; }
  RowKey row() const { return {slab_.hashes()[row_], slab_.masks()[row_], slab_.words() + word_}; }
  void advance() { word_ += kRowWords[slab_.masks()[row_++]]; }

 private:
  const Slab& slab_;
  uint64_t row_, end_, word_;
};

// Sweeps the ranges of one slab in parallel.
class SlabSweep {
 public:
  SlabSweep(const MergeContext& context, const LevelTask& task, Slab& slab, uint64_t first_position)
      : context_(context), task_(task), slab_(slab), turnstile_(first_position) {}

  LevelExtent run() {
    make_sweepers();
    parallel_for(context_.plan.workers, slab_.ranges(), [&](unsigned worker, size_t range) {
      try {
        context_.cancel.check();
        const uint64_t rows = range_extent(range).rows;
        if (fits(range_extent(range)))
          sweep(sweepers_[worker], range);
        else
          merge_by_rows(range);
        context_.progress.advance(rows);
      } catch (...) {
        turnstile_.close();
        throw;
      }
    });
    if (!task_.maps.resident()) store_positions();
    return {nodes_, positions_};
  }

 private:
  struct RangeExtent {
    uint64_t rows = 0;
    uint64_t words = 0;
  };

  RangeExtent range_extent(size_t range) const {
    RangeExtent sum;
    for (size_t p = 0; p < slab_.pieces().size(); ++p) {
      sum.rows += slab_.bound(range + 1, p).row - slab_.bound(range, p).row;
      sum.words += slab_.bound(range + 1, p).word - slab_.bound(range, p).word;
    }
    return sum;
  }

  bool fits(const RangeExtent& range) const {
    return range.rows <= RangeSweeper::kMaxRows &&
           RangeSweeper::bytes_for(range.rows, range.words) <= context_.plan.worker_bytes;
  }

  // One for each worker, large enough for every range that fits.
  void make_sweepers() {
    RangeExtent most;
    for (size_t range = 0; range < slab_.ranges(); ++range) {
      const RangeExtent extent = range_extent(range);
      if (!fits(extent)) continue;
      most.rows = std::max(most.rows, extent.rows);
      most.words = std::max(most.words, extent.words);
    }
    for (unsigned worker = 0; worker < context_.plan.workers; ++worker)
      sweepers_.emplace_back(context_.budget, task_.bricks, most.rows, most.words);
  }

  void sweep(RangeSweeper& sweeper, size_t range) {
    const bool in_words = task_.output.in_words();
    sweeper.sweep(slab_, range, in_words);
    const auto position = turnstile_.enter(range);
    if (!position) return;
    task_.output.add(sweeper.unique());
    pass(sweeper.unique().row_count(), sweeper.extent());
    task_.output.write(*position, sweeper.unique());
    const uint32_t* from = sweeper.positions().data();
    for (size_t p = 0; p < slab_.pieces().size(); ++p) {
      const uint32_t rows = slab_.bound(range + 1, p).row - slab_.bound(range, p).row;
      uint32_t* const to = positions_of(range, p);
      for (uint32_t i = 0; i < rows; ++i) to[i] = static_cast<uint32_t>(*position) + from[i];
      from += rows;
    }
  }

  void merge_by_rows(size_t range) {
    const auto position = turnstile_.enter(range);
    if (!position) return;
    OrderedRows out(task_.output, task_.bricks, *position, context_.budget);
    std::vector<PieceCursor> cursors;
    std::vector<uint32_t*> to;
    for (size_t p = 0; p < slab_.pieces().size(); ++p) {
      cursors.emplace_back(slab_, p, range);
      to.push_back(positions_of(range, p));
    }
    uint64_t rows = 0;
    merge_cursors(std::span(cursors), [&](size_t p, const RowKey& row) {
      *to[p]++ = static_cast<uint32_t>(out.add(row));
      if (++rows % kFrameRows == 0) context_.cancel.check();
    });
    out.flush();
    pass(out.nodes(), out.end_position() - *position);
  }

  // Within the range's turn.
  void pass(uint64_t nodes, uint64_t positions) {
    nodes_ += nodes;
    positions_ += positions;
    turnstile_.leave(positions);
  }

  // Where the positions of a piece's rows in a range go.
  uint32_t* positions_of(size_t range, size_t p) {
    const SlabPiece& piece = slab_.pieces()[p];
    const uint32_t row = slab_.bound(range, p).row;
    return task_.maps.resident() ? task_.maps.values(piece.run) + piece.first_row + row
                                 : slab_.positions() + piece.row_base + row;
  }

  void store_positions() {
    for (size_t p = 0; p < slab_.pieces().size(); ++p) {
      const SlabPiece& piece = slab_.pieces()[p];
      const uint32_t begin = slab_.bound(0, p).row, end = slab_.bound(slab_.ranges(), p).row;
      task_.maps.store(piece.run, piece.first_row + begin,
                       {slab_.positions() + piece.row_base + begin, end - begin});
    }
  }

  const MergeContext& context_;
  const LevelTask& task_;
  Slab& slab_;
  Sequencer turnstile_;
  std::vector<RangeSweeper> sweepers_;
  uint64_t nodes_ = 0, positions_ = 0;  // changed in turn
};

uint64_t range_rows(const MergeContext& context, size_t runs) {
  const uint64_t wanted = std::max<uint64_t>(kRangeRows, kRangeRowsEachRun * runs);
  // Half of what a worker's memory could take: ranges differ in size.
  return std::min(wanted, context.plan.worker_bytes / (2 * RangeSweeper::bytes_for(1, 8)));
}

LevelExtent merge_slab(const MergeContext& context, const LevelTask& task,
                       const HashInterval& interval, uint64_t first_position) {
  Slab slab(task.runs, Slab::pieces_within(task.runs, interval), interval,
            range_rows(context, task.runs.size()), !task.maps.resident(), task.memory,
            context.budget);
  slab.load(task.child_maps, {context.plan.workers, context.plan.worker_bytes}, context.budget,
            context.cancel);
  return SlabSweep(context, task, slab, first_position).run();
}

// The plan leaves room for two frames of every run: only a group of equal hashes that is longer
// than that in some run may fail to fit.
void check_many(const LevelTask& task, uint64_t hash) {
  for (const LevelRun* run : task.runs) {
    const FrameSpan frames = run->frames_within({hash, hash});
    if (frames.end - frames.begin > 2) return;
  }
  throw Error(ErrorCode::kOutOfMemory, "out of memory: level " + std::to_string(task.level) +
                                           " of " + std::to_string(task.runs.size()) +
                                           " runs does not fit the merge's memory");
}

}  // namespace

uint64_t bytes_for_workers(const MergeMemory& plan) {
  return plan.workers * std::max(plan.worker_bytes, OrderedRows::bytes());
}

LevelExtent merge_level(const MergeContext& context, const LevelTask& task) {
  for (const LevelRun* run : task.runs) context.report.input_nodes += run->rows();
  const uint64_t available = context.budget.available() + task.memory.bytes();
  const uint64_t for_workers = bytes_for_workers(context.plan);
  const uint64_t slab_bytes =
      MergeMemory::slab_within(available - std::min(available, for_workers));
  LevelExtent extent;
  HashInterval done{0, 0};
  for (uint64_t first = 0;; first = done.last + 1) {
    const auto interval =
        Slab::widest_interval(task.runs, first, slab_bytes, !task.maps.resident());
    LevelExtent part;
    if (interval) {
      done = *interval;
      part = merge_slab(context, task, done, extent.positions);
      ++context.report.hash_ranges;
    } else {
      check_many(task, first);
      done = {first, first};
      part = stream_group(context, task, first, extent.positions, slab_bytes);
      ++context.report.streamed_groups;
    }
    extent.add(part.nodes, part.positions, task.level, task.output.in_words());
    if (done.last == ~uint64_t{0}) return extent;
  }
}

}  // namespace voxdag
