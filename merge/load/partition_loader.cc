// Loads a hash partition: decodes its frames and replaces children by positions (rewires them).
#include <algorithm>
#include <memory>
#include <vector>

#include "core/base/parallel_for.h"
#include "merge/load/hash_partition.h"

namespace voxdag {
namespace {

// Frames per work item if the position maps are in memory. A thread that loads this many
// consecutive frames of a run finds most of the run's map in its cache.
constexpr size_t kFramesPerItem = 16;

// Replaces row indices by positions: writes map[child] to `out` for each of `children`, as two
// words if `wide` is set. `map` can have two words per position although `wide` is false: its width
// is chosen before its level is merged, for the maximum size of the merged level. `wide` is chosen
// afterwards, for the actual size.
void replace_all(std::span<const uint32_t> children, const uint32_t* map, bool wide_map, bool wide,
                 uint32_t* out) {
  if (!wide_map) {
    for (size_t i = 0; i < children.size(); ++i) out[i] = map[children[i]];
    return;
  }
  for (const uint32_t child : children)
    out = put_position(out, get_position(map + 2 * uint64_t{child}, true), wide);
}

}  // namespace

class HashPartition::Loader {
 public:
  Loader(HashPartition& partition, const PositionMaps* maps, const PartitionWorkers& workers,
         MemoryBudget& budget)
      : partition_(partition),
        maps_(maps),
        spilled_(maps && !maps->is_resident()),
        workers_(workers.count) {
    if (spilled_) {
      const uint64_t window_bytes =
          std::max(workers.bytes_each, kFrameMemoryBytes) - kFrameMemoryBytes;
      window_rows_ =
          std::clamp<uint64_t>(window_bytes / (sizeof(uint32_t) * maps->position_words()), 1024,
                               maps->max_rows() + 1024);
    }
    for (Worker& worker : workers_) {
      worker.charge = MemoryCharge(budget, kFrameMemoryBytes, "a frame of the merge");
      if (spilled_)
        worker.window = PageBuffer<uint32_t>(budget, window_rows_ * maps->position_words(),
                                             "a window of a position map");
    }
  }

  // Returns the work items. Each item is a range of consecutive frames of one slice.
  // slice_of_item[i] is the index of the slice of item i. If the position maps are in a scratch
  // file, an item has all frames of its slice, so that the map of the slice's run is loaded only
  // once.
  std::vector<FrameSpan> items(std::vector<size_t>& slice_of_item) const {
    std::vector<FrameSpan> spans;
    for (size_t s = 0; s < partition_.slices_.size(); ++s) {
      const FrameSpan frames = partition_.slices_[s].frames;
      const size_t step = spilled_ ? frames.end - frames.begin : kFramesPerItem;
      for (size_t begin = frames.begin; begin < frames.end; begin += step) {
        spans.push_back({begin, std::min(begin + step, frames.end)});
        slice_of_item.push_back(s);
      }
    }
    return spans;
  }

  void load(unsigned worker_index, size_t slice_index, const FrameSpan& frames,
            const CancelToken& cancel) {
    Worker& worker = workers_[worker_index];
    const RunSlice& slice = partition_.slices_[slice_index];
    const LevelRun& run = *partition_.runs_[slice.run];
    const bool rewire = !run.bricks() && !run.is_rewired();
    const bool by_windows = rewire && spilled_ && maps_->rows(slice.run) > window_rows_;
    const uint32_t* map = nullptr;
    if (rewire && !spilled_) map = maps_->words(slice.run);
    if (rewire && spilled_ && !by_windows)
      map = load_window(worker, slice, 0, maps_->rows(slice.run));
    for (size_t f = frames.begin; f < frames.end; ++f) {
      cancel.check();
      run.read_frame(f, worker.frame);
      place(slice, run, f, worker.frame, map);
      mark_bucket_begins(slice_index, run, f, worker.frame);
    }
    if (by_windows) replace_by_windows(worker, slice, cancel);
  }

 private:
  struct Worker {
    MemoryCharge charge;
    Frame frame;
    PageBuffer<uint32_t> window;
    std::vector<bool> replaced;  // one flag per child of a slice; see HashPartition::bytes_for()
  };

  // Copies a frame into the columns. If `map` is null, copies the children without replacing them.
  void place(const RunSlice& slice, const LevelRun& run, size_t f, const Frame& frame,
             const uint32_t* map) {
    const uint64_t row = slice.row_base + run.rows_before(f) - slice.first_row;
    const uint64_t word =
        slice.word_base + run.words_before(f) - run.words_before(slice.frames.begin);
    std::copy(frame.hashes.begin(), frame.hashes.end(), partition_.memory_.hashes_.data() + row);
    uint32_t* out = partition_.memory_.words_.data() + word;
    if (run.bricks()) {
      std::fill_n(partition_.memory_.masks_.data() + row, frame.rows, kBrickRowMask);
      for (const uint64_t mask : frame.brick_masks) {
        *out++ = static_cast<uint32_t>(mask >> 32);
        *out++ = static_cast<uint32_t>(mask);
      }
      return;
    }
    std::copy(frame.masks.begin(), frame.masks.end(), partition_.memory_.masks_.data() + row);
    if (map)
      replace_all(frame.children, map, maps_->wide(), run.format().wide, out);
    else if (run.is_rewired() || !run.format().wide)
      std::copy(frame.children.begin(), frame.children.end(), out);
    else
      for (const uint32_t child : frame.children) out = put_position(out, child, true);
  }

  // Loads the positions of `rows` rows of the slice's run, from row `first` on, into the worker's
  // window. Returns the window's first word.
  const uint32_t* load_window(Worker& worker, const RunSlice& slice, uint64_t first,
                              uint64_t rows) const {
    maps_->load(slice.run, first, {worker.window.data(), rows * maps_->position_words()});
    return worker.window.data();
  }

  // Returns the number of buckets that begin at or before `hash`. If `hash` is after the
  // partition's last hash, returns the number of all buckets plus one, which also counts the end of
  // the last bucket.
  size_t begins_up_to(uint64_t hash) const {
    const HashInterval& interval = partition_.interval_;
    if (hash < interval.first) return 0;
    if (hash > interval.last) return partition_.bucket_count_ + 1;
    return (hash >> partition_.bucket_bits_) - (interval.first >> partition_.bucket_bits_) + 1;
  }

  // Sets bucket_begins_ for the buckets whose lowest hash is above the first hash of this frame but
  // not above the first hash of the next frame. The call for the slice's first frame also sets it
  // for all earlier buckets, and the call for the last frame for all later buckets.
  void mark_bucket_begins(size_t slice_index, const LevelRun& run, size_t f, const Frame& frame) {
    const RunSlice& slice = partition_.slices_[slice_index];
    size_t next = f == slice.frames.begin ? 0 : begins_up_to(frame.hashes.front());
    const size_t end = f + 1 < slice.frames.end ? begins_up_to(run.frames()[f + 1].first_hash)
                                                : partition_.bucket_count_ + 1;
    RowOffset here{
        static_cast<uint32_t>(run.rows_before(f) - slice.first_row),
        static_cast<uint32_t>(run.words_before(f) - run.words_before(slice.frames.begin))};
    const auto mark = [&] {
      partition_.bucket_begins_[next++ * partition_.slices_.size() + slice_index] = here;
    };
    const uint8_t* masks = partition_.memory_.masks_.data() + slice.row_base + here.row;
    for (size_t i = 0; i < frame.rows && next < end; ++i) {
      while (next < end && reached(next, frame.hashes[i])) mark();
      ++here.row;
      here.word += run.format().words(masks[i]);
    }
    if (next == end) return;
    here.row = static_cast<uint32_t>(run.rows_before(f + 1) - slice.first_row);
    here.word =
        static_cast<uint32_t>(run.words_before(f + 1) - run.words_before(slice.frames.begin));
    while (next < end) mark();
  }

  bool reached(size_t bucket, uint64_t hash) const {
    return bucket < partition_.bucket_count_ ? hash >= partition_.first_hash(bucket)
                                             : hash > partition_.interval_.last;
  }

  // Replaces the children of a slice if its run's position map is larger than the worker's memory.
  // Loads the map window by window, and replaces the children whose positions are in the window.
  void replace_by_windows(Worker& worker, const RunSlice& slice, const CancelToken& cancel) {
    const bool wide = partition_.format().wide;
    const uint64_t children = slice.size.words >> wide;
    worker.replaced.assign(children, false);
    uint32_t* const words = partition_.memory_.words_.data() + slice.word_base;
    const uint64_t map_rows = maps_->rows(slice.run);
    for (uint64_t first = 0; first < map_rows; first += window_rows_) {
      cancel.check();
      const uint64_t rows = std::min(window_rows_, map_rows - first);
      const uint32_t* const window = load_window(worker, slice, first, rows);
      for (uint64_t i = 0; i < children; ++i) {
        uint32_t* const child = words + (i << wide);
        const uint64_t row = get_position(child, wide);
        if (worker.replaced[i] || row < first || row - first >= rows) continue;
        const uint32_t* const position = window + (row - first) * maps_->position_words();
        put_position(child, get_position(position, maps_->wide()), wide);
        worker.replaced[i] = true;
      }
    }
  }

  HashPartition& partition_;
  const PositionMaps* const maps_;
  const bool spilled_;
  uint64_t window_rows_ = 0;  // positions per window
  std::vector<Worker> workers_;
};

void HashPartition::load(const PositionMaps* child_maps, const PartitionWorkers& workers,
                         MemoryBudget& budget, const CancelToken& cancel) {
  Loader loader(*this, child_maps, workers, budget);
  std::vector<size_t> slice_of_item;
  const std::vector<FrameSpan> items = loader.items(slice_of_item);
  parallel_for(workers.count, items.size(), [&](unsigned worker, size_t item) {
    loader.load(worker, slice_of_item[item], items[item], cancel);
  });
}

}  // namespace voxdag
