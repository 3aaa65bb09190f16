// Lists that are in memory while they are small, and otherwise in a scratch file:
//
//   SpillList     items in the order in which they were added
//   SpillSorter   items in increasing order, by external sorting
//   SpillBuckets  many lists in one file, each in the order in which its items were added
//
// All items are added first, then they are read. Not thread-safe. All functions throw the errors of
// ScratchFile, and Error{kOutOfMemory} if the budget cannot hold a buffer.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "merge/load/scratch_file.h"

namespace voxdag::query {

// The folder to which the lists below write scratch files, and the memory that a list may use.
struct SpillSpace {
  ScratchFolder& folder;
  MemoryBudget& budget;
  uint64_t list_bytes = 0;    // maximum memory of a SpillList
  uint64_t sorter_bytes = 0;  // maximum memory of a SpillSorter before finish()
  uint64_t buffer_bytes = 0;  // size of the buffers with which scratch files are read
};

// A scratch file of items. Positions and counts are in items, not bytes.
template <class T>
class ItemFile {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % sizeof(uint32_t) == 0);

 public:
  explicit ItemFile(ScratchFolder& folder) : file_(folder) {}

  void write(uint64_t first, const T* items, uint64_t count) {
    uint32_t words[kBufferItems * kWords];
    for (uint64_t done = 0; done < count; done += kBufferItems) {
      const uint64_t part = std::min(kBufferItems, count - done);
      std::memcpy(words, items + done, part * sizeof(T));
      file_.write((first + done) * kWords, {words, part * kWords});
    }
  }
  void read(uint64_t first, T* items, uint64_t count) const {
    uint32_t words[kBufferItems * kWords];
    for (uint64_t done = 0; done < count; done += kBufferItems) {
      const uint64_t part = std::min(kBufferItems, count - done);
      file_.read((first + done) * kWords, {words, part * kWords});
      std::memcpy(items + done, words, part * sizeof(T));
    }
  }

 private:
  static constexpr uint64_t kWords = sizeof(T) / sizeof(uint32_t);
  static constexpr uint64_t kBufferItems = std::max<uint64_t>((uint64_t{16} << 10) / sizeof(T), 1);

  ScratchFile file_;
};

inline constexpr std::string_view kSpillBuffer = "a list of nodes";
// Returns the number of items that fit in `bytes`, but at least two.
template <class T>
uint64_t spill_items(uint64_t bytes) {
  return std::max<uint64_t>(bytes / sizeof(T), 2);
}

// A buffer of items that grows up to a maximum size.
template <class T>
class GrowingItems {
 public:
  uint64_t size() const { return count_; }
  const T* data() const { return buffer_.data(); }
  T* data() { return buffer_.data(); }
  const T& operator[](uint64_t i) const { return buffer_[i]; }
  // Adds the item, and returns true. If the buffer already has `max` items, changes nothing and
  // returns false.
  bool try_add(const T& item, uint64_t max, MemoryBudget& budget) {
    if (count_ == buffer_.size() && !grow(max, budget)) return false;
    buffer_[count_++] = item;
    return true;
  }
  // Replaces all items by those of `buffer`.
  void adopt(PageBuffer<T> buffer) {
    buffer_ = std::move(buffer);
    count_ = buffer_.size();
  }
  void clear() { count_ = 0; }
  void free() {
    buffer_ = {};
    count_ = 0;
  }

 private:
  static constexpr uint64_t kFirstItems = 128;
  bool grow(uint64_t max, MemoryBudget& budget) {
    if (count_ >= max) return false;
    const uint64_t size = std::min(max, std::max(kFirstItems, 2 * count_));
    if (count_ == 0)
      buffer_ = PageBuffer<T>(budget, size, kSpillBuffer);
    else
      buffer_.grow(size, kSpillBuffer);
    return true;
  }

  PageBuffer<T> buffer_;
  uint64_t count_ = 0;
};

template <class T>
class SpillList {
 public:
  explicit SpillList(const SpillSpace& space) : space_(&space) {}

  uint64_t size() const { return stored_ + items_.size(); }
  void add(const T& item) {
    const uint64_t max = spill_items<T>(space_->list_bytes);
    if (items_.try_add(item, max, space_->budget)) return;
    flush();
    items_.try_add(item, max, space_->budget);
  }
  // True if the list can have `count` items in memory.
  bool has_room(uint64_t count) const { return count <= spill_items<T>(space_->list_bytes); }
  // Replaces all items by those of `items`. Requires has_room(items.size()).
  void adopt(PageBuffer<T> items) { items_.adopt(std::move(items)); }
  // Completes the list. Must be called after the last item was added, before the list is read.
  void finish() {
    if (!file_) return;
    flush();
    items_.free();
  }

 private:
  template <class>
  friend class SpillReader;
  void flush() {
    if (!file_) file_ = std::make_unique<ItemFile<T>>(space_->folder);
    file_->write(stored_, items_.data(), items_.size());
    stored_ += items_.size();
    items_.clear();
  }

  const SpillSpace* space_;
  GrowingItems<T> items_;
  std::unique_ptr<ItemFile<T>> file_;
  uint64_t stored_ = 0;  // items in the file
};

// Reads a finished list, which must outlive the reader, from its beginning.
template <class T>
class SpillReader {
 public:
  explicit SpillReader(const SpillList<T>& list) : list_(&list), left_(list.size()) {
    if (list.file_)
      buffer_ = PageBuffer<T>(list.space_->budget, spill_items<T>(list.space_->buffer_bytes),
                              kSpillBuffer);
    load();
  }
  bool at_end() const { return left_ == 0; }
  const T& front() const { return *at_; }
  void pop() {
    --left_;
    if (++at_ == end_) load();
  }

 private:
  void load() {
    if (!list_->file_) {
      at_ = list_->items_.data();
      end_ = at_ + list_->size();
      return;
    }
    const uint64_t count = std::min<uint64_t>(left_, buffer_.size());
    list_->file_->read(list_->size() - left_, buffer_.data(), count);
    at_ = buffer_.data();
    end_ = at_ + count;
  }

  const SpillList<T>* list_;
  uint64_t left_;
  PageBuffer<T> buffer_;
  const T* at_ = nullptr;
  const T* end_ = nullptr;
};

// Sorts items. T must have an operator <. Items that do not fit in memory are written as sorted
// runs, which are merged when the items are read.
template <class T>
class SpillSorter {
 public:
  explicit SpillSorter(const SpillSpace& space) : space_(&space) {}

  uint64_t size() const { return size_; }
  void add(const T& item) {
    ++size_;
    const uint64_t max = spill_items<T>(space_->sorter_bytes);
    if (items_.try_add(item, max, space_->budget)) return;
    store_run();
    items_.try_add(item, max, space_->budget);
  }
  // Completes the sorter. Must be called after the last item was added. `retain` means that the
  // items are read much later. Then they are kept in memory only if they take at most
  // SpillSpace::list_bytes.
  void finish(bool retain = false) {
    sort();
    if (runs_.empty() && !(retain && items_.size() * sizeof(T) > space_->list_bytes)) return;
    store_run();
    items_.free();
  }
  // Moves to the first item in sorted order. Must be called once, after finish().
  void begin() {
    left_ = size_;
    const uint64_t count = std::max<uint64_t>(runs_.size(), 1);
    for (Run& run : runs_) {
      run.buffer = PageBuffer<T>(
          space_->budget,
          spill_items<T>(std::max(space_->sorter_bytes / count, space_->buffer_bytes)),
          kSpillBuffer);
      load(run);
      heap_.push_back(&run);
    }
    std::make_heap(heap_.begin(), heap_.end(), is_later);
  }
  bool at_end() const { return left_ == 0; }
  const T& front() const { return runs_.empty() ? items_[size_ - left_] : heap_.front()->front(); }
  void pop() {
    --left_;
    if (runs_.empty()) return;
    std::pop_heap(heap_.begin(), heap_.end(), is_later);
    Run& run = *heap_.back();
    if (++run.at == run.count) load(run);
    if (run.count == 0)
      heap_.pop_back();
    else
      std::push_heap(heap_.begin(), heap_.end(), is_later);
  }

 private:
  struct Run {
    uint64_t next = 0;  // position in the file of the next item to load
    uint64_t end = 0;   // position in the file after the run's last item
    PageBuffer<T> buffer = {};
    uint64_t at = 0;     // index of the run's front item in the buffer
    uint64_t count = 0;  // number of items in the buffer
    const T& front() const { return buffer[at]; }
  };
  static bool is_later(const Run* a, const Run* b) { return b->front() < a->front(); }

  void sort() { std::sort(items_.data(), items_.data() + items_.size()); }
  void store_run() {
    sort();
    if (items_.size() == 0) return;
    if (!file_) file_ = std::make_unique<ItemFile<T>>(space_->folder);
    file_->write(stored_, items_.data(), items_.size());
    runs_.push_back({stored_, stored_ + items_.size()});
    stored_ += items_.size();
    items_.clear();
  }
  void load(Run& run) {
    run.at = 0;
    run.count = std::min<uint64_t>(run.end - run.next, run.buffer.size());
    file_->read(run.next, run.buffer.data(), run.count);
    run.next += run.count;
  }

  const SpillSpace* space_;
  GrowingItems<T> items_;
  std::unique_ptr<ItemFile<T>> file_;
  std::vector<Run> runs_;
  std::vector<Run*> heap_;
  uint64_t size_ = 0;
  uint64_t stored_ = 0;
  uint64_t left_ = 0;
};

// The items of a bucket are in chunks of the same size, which form a linked list in the file. So
// the memory does not depend on the number of items.
template <class T>
class SpillBuckets {
  static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % sizeof(uint32_t) == 0);

 public:
  // The buffers of all buckets together take about `bytes`.
  SpillBuckets(const SpillSpace& space, size_t buckets, uint64_t bytes)
      : chunk_items_(std::bit_floor(std::clamp<uint64_t>(bytes / sizeof(T) / buckets, 4, 4096))),
        chunk_words_(chunk_items_ * kItemWords + kLinkWords),
        buffers_(space.budget, chunk_words_ * buckets, kSpillBuffer),
        buckets_(space.budget, buckets, kSpillBuffer),
        file_(space.folder) {}

  void add(size_t bucket, const T& item) {
    Bucket& to = buckets_[bucket];
    if (to.size++ == 0) to.first = to.chunk = chunks_++;
    std::memcpy(item_at(bucket, to.buffered), &item, sizeof(T));
    if (++to.buffered == chunk_items_) store(bucket, chunks_++);
  }
  // Completes the lists. Must be called after the last item was added, before next().
  void finish() {
    for (size_t bucket = 0; bucket < buckets_.size(); ++bucket) {
      // The last chunk is written even if it is empty, because the file must not have gaps.
      if (buckets_[bucket].size > 0) store(bucket, kNone);
      rewind(bucket);
    }
  }
  uint64_t size(size_t bucket) const { return buckets_[bucket].size; }
  // Returns the next item of the bucket, which must have one.
  T next(size_t bucket) {
    Bucket& from = buckets_[bucket];
    if (from.buffered == 0) load(bucket);
    T item;
    std::memcpy(static_cast<void*>(&item), item_at(bucket, chunk_items_ - from.buffered--),
                sizeof(T));
    return item;
  }
  // Moves back to the first item of the bucket.
  void rewind(size_t bucket) {
    buckets_[bucket].chunk = buckets_[bucket].first;
    buckets_[bucket].buffered = 0;
  }

 private:
  static constexpr uint64_t kItemWords = sizeof(T) / sizeof(uint32_t);
  static constexpr uint64_t kLinkWords = sizeof(uint64_t) / sizeof(uint32_t);
  static constexpr uint64_t kNone = ~uint64_t{0};

  struct Bucket {
    uint64_t first = 0;  // number of the bucket's first chunk in the file
    uint64_t chunk = 0;  // number of the chunk that is stored or loaded next
    uint64_t size = 0;
    // Items in the buffer. While the bucket is read, items of the current chunk that next() has not
    // returned yet; a chunk that is not full counts as a full one.
    uint64_t buffered = 0;
  };
  // The buffer of a bucket has the items of a chunk, and then the number of the bucket's next
  // chunk.
  uint32_t* buffer(size_t bucket) { return buffers_.data() + bucket * chunk_words_; }
  uint32_t* item_at(size_t bucket, uint64_t i) { return buffer(bucket) + i * kItemWords; }
  uint32_t* link(size_t bucket) { return buffer(bucket) + chunk_items_ * kItemWords; }

  void load(size_t bucket) {
    Bucket& from = buckets_[bucket];
    file_.read(from.chunk * chunk_words_, {buffer(bucket), chunk_words_});
    std::memcpy(&from.chunk, link(bucket), sizeof(from.chunk));
    from.buffered = chunk_items_;
  }
  // Writes the bucket's buffer as a chunk, even the part without items, because all chunks have the
  // same size. `next` is the number of the bucket's next chunk.
  void store(size_t bucket, uint64_t next) {
    Bucket& from = buckets_[bucket];
    std::memcpy(link(bucket), &next, sizeof(next));
    file_.write(from.chunk * chunk_words_, {buffer(bucket), chunk_words_});
    from.chunk = next;
    from.buffered = 0;
  }

  const uint64_t chunk_items_;
  const uint64_t chunk_words_;
  PageBuffer<uint32_t> buffers_;
  PageBuffer<Bucket> buckets_;
  ScratchFile file_;
  uint64_t chunks_ = 0;  // chunks that have a number
};

}  // namespace voxdag::query
