// A level that does not fit in memory, for the order by first parent (first_parent.h). The level is
// divided into *windows* that fit in memory, ranges of word offsets in the input file. The
// caller goes through all pointers into the level three times, in the order of the output file:
//
//   1. request() adds the pointer to the requests of its window. find_first() then loads one window
//      after the other, and finds the first pointer to each node.
//   2. first_to() returns the node's words if the pointer is the first one to its node. The caller
//      places the node, and calls place() with its new offset. resolve() then passes through the
//      windows again, and finds the new offset for each request.
//   3. offset_of() returns the new offset of the node.
//
// These functions exchange their data through scratch files: for each window, there are
// lists in which the items have the order of the pointers. So nothing is sorted.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "core/base/page_buffer.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

class WindowedLevel {
 public:
  // `window_bytes` is the memory of a window, and `list_bytes` the approximate memory for the
  // buffers of the lists of one kind. Up to four kinds exist at the same time.
  WindowedLevel(DagInput& input, uint32_t level, const SpillSpace& space, uint64_t window_bytes,
                uint64_t list_bytes);

  // Throw Error{kCorrupt} if the pointer does not refer to a node of the level. find_first() also
  // throws it if a node of the level was not requested.
  void request(uint64_t offset);
  void find_first(const CancelToken& cancel);
  // Returns no words if the pointer is not the first one to its node. The result is valid until the
  // next call.
  std::span<const uint32_t> first_to(uint64_t offset);
  void place(uint64_t offset, uint64_t new_offset) {
    placed_->add(offset >> window_shift_, new_offset);
  }
  void resolve(const CancelToken& cancel);
  uint64_t offset_of(uint64_t offset) { return answers_->next(offset >> window_shift_); }

 private:
  template <class T>
  using Lists = std::unique_ptr<SpillBuckets<T>>;

  template <class T>
  Lists<T> make_lists() const {
    return std::make_unique<SpillBuckets<T>>(space_, windows_, list_bytes_);
  }
  uint64_t node_words(uint64_t offset, uint32_t first_word) const;
  void find_first(size_t window, uint64_t& node, const CancelToken& cancel);
  [[noreturn]] void no_node(uint64_t offset) const;

  DagInput& input_;
  const uint32_t level_;
  const SpillSpace& space_;
  const uint64_t list_bytes_;
  const uint64_t words_;  // words of the level
  const bool is_brick_level_;
  const bool is_wide_;
  int window_shift_ = 0;  // the words of a window are a power of two
  size_t windows_ = 0;

  // One list for each window, see the top of this file. Requests are word offsets in the window.
  // `sizes_` has a number for each request: the words of the node if it is the first request of the
  // node, otherwise 0. `nodes_` has the words of the nodes in the order of their first requests,
  // and `placed_` their new offsets. `answers_` has a new offset for each request.
  Lists<uint32_t> requests_;
  Lists<uint32_t> sizes_;
  Lists<uint32_t> nodes_;
  Lists<uint64_t> placed_;
  Lists<uint64_t> answers_;
  std::array<uint32_t, global_layout::kMaxNodeWords> node_ = {};  // the result of first_to()
};

}  // namespace voxdag::query
