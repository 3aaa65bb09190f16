// The values of all children of a level's nodes, if the children are a stored level
// (checked_level.h). The child level is divided into *windows* that fit in memory, ranges of words.
// For each span of the parent level:
//
//   1. The pointers go to a scratch file, one list for each window.
//   2. One window after the other is loaded. For each pointer in the span's list of this window,
//      the child's values go to a second scratch file.
//   3. load() reads all these values. The values of one window follow one another in the order of
//      their pointers, so the next value for a pointer is the next one of its window (ChildSlots).
//
// So nothing is sorted, and each scratch file is written and read once. A pointer that leads to no
// node has the values of SubtreeWords::set_broken().
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/format/verify/checked_level.h"
#include "core/format/verify/node_batch.h"
#include "core/format/verify/span_file.h"

namespace voxdag {

class ChildValues {
 public:
  // Memory of a thread.
  struct Buffer {
    SpanLists::Buffer lists;
    std::vector<uint32_t> values;
    std::vector<uint32_t> next;  // for ChildSlots
    ChildSlots slots;
  };

  // Finds the values of all children. `parents` are the spans of the level above `children`. A
  // window takes about `window_bytes`, but at least one span. The objects must outlive this one.
  // Reports progress of as many nodes as both levels have.
  ChildValues(const VerifyTask& task, const NodeSpans& parents, const CheckedLevel& children,
              uint64_t window_bytes);

  // Returns the number of words of the scratch files.
  static uint64_t scratch_words(const NodeSpans& parents, const CheckedLevel& children);

  // Returns the index of the first child without a parent, or NodeIndex::kNone.
  uint64_t first_orphan() const { return first_orphan_; }
  // Reads the values for a span: the children of the last node before the span, then the children
  // of the nodes that begin in the span. The result uses `buffer`.
  NodeLevel load(uint64_t span, Buffer& buffer) const;

 private:
  template <class Visit>
  void visit_pointers(uint64_t span, const Visit& visit) const;
  void choose_windows(uint64_t window_bytes);
  void list_pointers(SpanLists& lists);
  void find_values(SpanLists& lists, uint64_t window);
  void append_values(uint64_t span, std::span<const uint32_t> pointers, LevelWindow& window,
                     Buffer& buffer);

  const VerifyTask& task_;
  const NodeSpans& parents_;
  const CheckedLevel& children_;
  const uint32_t node_words_;
  unsigned threads_;
  ChildSlots slots_;  // without `next` and `count`
  std::unique_ptr<SpanFile> values_;
  uint64_t first_orphan_ = NodeIndex::kNone;
};

}  // namespace voxdag
