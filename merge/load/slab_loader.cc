// The step "rewire": decodes the frames of a slab and replaces children by positions.
#include <algorithm>
#include <memory>
#include <vector>

#include "core/base/parallel_for.h"
#include "merge/load/slab.h"

namespace voxdag {
namespace {

// Frames that one thread takes at once when the maps are in memory: enough that the run's map stays
// in its cache.
constexpr size_t kFramesAtOnce = 16;

void replace_all(std::span<const uint32_t> children, const uint32_t* map, uint32_t* out) {
  for (size_t i = 0; i < children.size(); ++i) out[i] = map[children[i]];
}

}  // namespace

class Slab::Loader {
 public:
  Loader(Slab& slab, const PositionMaps* maps, const SlabWorkers& workers, MemoryBudget& budget)
      : slab_(slab), maps_(maps), spilled_(maps && !maps->resident()), workers_(workers.count) {
    uint64_t window_rows = 0;
    if (spilled_) {
      const uint64_t room = std::max(workers.bytes_each, kFrameMemory) - kFrameMemory;
      window_rows = std::clamp<uint64_t>(room / sizeof(uint32_t), 1024, maps->max_rows() + 1024);
    }
    for (Worker& worker : workers_) {
      worker.charge = MemoryCharge(budget, kFrameMemory, "a frame of the merge");
      worker.window = PageBuffer<uint32_t>(budget, window_rows, "a window of a position map");
    }
  }

  // Spilled maps are loaded once for all frames of a piece.
  std::vector<FrameSpan> items(std::vector<size_t>& piece_of_item) const {
    std::vector<FrameSpan> spans;
    for (size_t p = 0; p < slab_.pieces_.size(); ++p) {
      const FrameSpan frames = slab_.pieces_[p].frames;
      const size_t step = spilled_ ? frames.end - frames.begin : kFramesAtOnce;
      for (size_t begin = frames.begin; begin < frames.end; begin += step) {
        spans.push_back({begin, std::min(begin + step, frames.end)});
        piece_of_item.push_back(p);
      }
    }
    return spans;
  }

  void load(unsigned worker_index, size_t piece_index, const FrameSpan& frames,
            const CancelToken& cancel) {
    Worker& worker = workers_[worker_index];
    const SlabPiece& piece = slab_.pieces_[piece_index];
    const LevelRun& run = *slab_.runs_[piece.run];
    const bool rewire = !run.bricks() && !run.rewired();
    const bool by_windows = rewire && spilled_ && maps_->rows(piece.run) > worker.window.size();
    const uint32_t* map = nullptr;
    if (rewire && !spilled_) map = maps_->values(piece.run);
    if (rewire && spilled_ && !by_windows) {
      maps_->load(piece.run, 0, {worker.window.data(), maps_->rows(piece.run)});
      map = worker.window.data();
    }
    for (size_t f = frames.begin; f < frames.end; ++f) {
      cancel.check();
      run.read_frame(f, worker.frame);
      place(piece, run, f, worker.frame, map);
      mark_bounds(piece_index, run, f, worker.frame);
    }
    if (by_windows) replace_by_windows(worker, piece, cancel);
  }

 private:
  struct Worker {
    MemoryCharge charge;
    Frame frame;
    PageBuffer<uint32_t> window;
    std::vector<bool> replaced;  // a bit for each word of a piece, counted in Slab::bytes_for()
  };

  // Copies a frame into the columns; without a map its children stay as they are.
  void place(const SlabPiece& piece, const LevelRun& run, size_t f, const Frame& frame,
             const uint32_t* map) {
    const uint64_t row = piece.row_base + run.rows_before(f) - piece.first_row;
    const uint64_t word =
        piece.word_base + run.words_before(f) - run.words_before(piece.frames.begin);
    std::copy(frame.hashes.begin(), frame.hashes.end(), slab_.memory_.hashes_.data() + row);
    uint32_t* out = slab_.memory_.words_.data() + word;
    if (run.bricks()) {
      std::fill_n(slab_.memory_.masks_.data() + row, frame.rows, kBrickRowMask);
      for (const uint64_t mask : frame.brick_masks) {
        *out++ = static_cast<uint32_t>(mask >> 32);
        *out++ = static_cast<uint32_t>(mask);
      }
      return;
    }
    std::copy(frame.masks.begin(), frame.masks.end(), slab_.memory_.masks_.data() + row);
    if (map)
      replace_all(frame.children, map, out);
    else
      std::copy(frame.children.begin(), frame.children.end(), out);
  }

  // Bounds that this frame's first row, or one after it, has not reached; see Slab::bound().
  size_t bounds_reached(uint64_t hash) const {
    const HashInterval& interval = slab_.interval_;
    if (hash < interval.first) return 0;
    if (hash > interval.last) return slab_.range_count_ + 1;
    return (hash >> slab_.range_bits_) - (interval.first >> slab_.range_bits_) + 1;
  }

  // Sets the bounds that lie after this frame's first row, up to the next frame's first row.
  void mark_bounds(size_t piece_index, const LevelRun& run, size_t f, const Frame& frame) {
    const SlabPiece& piece = slab_.pieces_[piece_index];
    size_t next = f == piece.frames.begin ? 0 : bounds_reached(frame.hashes.front());
    const size_t end = f + 1 < piece.frames.end ? bounds_reached(run.frames()[f + 1].first_hash)
                                                : slab_.range_count_ + 1;
    SlabBound here{
        static_cast<uint32_t>(run.rows_before(f) - piece.first_row),
        static_cast<uint32_t>(run.words_before(f) - run.words_before(piece.frames.begin))};
    const auto mark = [&] { slab_.bounds_[next++ * slab_.pieces_.size() + piece_index] = here; };
    const uint8_t* masks = slab_.memory_.masks_.data() + piece.row_base + here.row;
    for (size_t i = 0; i < frame.rows && next < end; ++i) {
      while (next < end && reached(next, frame.hashes[i])) mark();
      ++here.row;
      here.word += kRowWords[masks[i]];
    }
    if (next == end) return;
    here.row = static_cast<uint32_t>(run.rows_before(f + 1) - piece.first_row);
    here.word =
        static_cast<uint32_t>(run.words_before(f + 1) - run.words_before(piece.frames.begin));
    while (next < end) mark();
  }

  bool reached(size_t bound, uint64_t hash) const {
    return bound < slab_.range_count_ ? hash >= slab_.first_hash(bound)
                                      : hash > slab_.interval_.last;
  }

  // The run's map is larger than the memory for it: one window of it at a time.
  void replace_by_windows(Worker& worker, const SlabPiece& piece, const CancelToken& cancel) {
    worker.replaced.assign(piece.words, false);
    uint32_t* const words = slab_.memory_.words_.data() + piece.word_base;
    const uint64_t map_rows = maps_->rows(piece.run);
    for (uint64_t first = 0; first < map_rows; first += worker.window.size()) {
      cancel.check();
      const uint64_t rows = std::min<uint64_t>(worker.window.size(), map_rows - first);
      maps_->load(piece.run, first, {worker.window.data(), rows});
      for (uint64_t i = 0; i < piece.words; ++i) {
        if (worker.replaced[i] || words[i] < first || words[i] - first >= rows) continue;
        words[i] = worker.window[words[i] - first];
        worker.replaced[i] = true;
      }
    }
  }

  Slab& slab_;
  const PositionMaps* const maps_;
  const bool spilled_;
  std::vector<Worker> workers_;
};

void Slab::load(const PositionMaps* child_maps, const SlabWorkers& workers, MemoryBudget& budget,
                const CancelToken& cancel) {
  Loader loader(*this, child_maps, workers, budget);
  std::vector<size_t> piece_of_item;
  const std::vector<FrameSpan> items = loader.items(piece_of_item);
  parallel_for(workers.count, items.size(), [&](unsigned worker, size_t item) {
    loader.load(worker, piece_of_item[item], items[item], cancel);
  });
}

}  // namespace voxdag
