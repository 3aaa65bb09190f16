// Reads nodes of a global file with read calls of limited size. A mapping would make the resident
// memory grow with the file. The checksum blocks that contain the nodes are verified when they are
// read for the first time.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/format/global/voxdag_reader.h"
#include "query/attributes/checked_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// An entry of a list of nodes to read. `offset` is the node's word offset in its level. `index` is
// the caller's number of the node.
struct WantedNode {
  uint64_t offset = 0;
  uint64_t index = 0;
};

// Reads nodes one by one, or many nodes in the order of their offsets, into a buffer called the
// window. Not thread-safe.
class NodeReader {
 public:
  static constexpr uint64_t kBufferBytes = uint64_t{1} << 19;
  // Bytes that a NodeReader charges to the budget.
  static constexpr uint64_t kMemoryBytes = kBufferBytes + CheckedReader::kBlockBytes;

  NodeReader(CheckedReader& source, MemoryBudget& budget, const CancelToken& cancel)
      : source_(source),
        cancel_(cancel),
        buffer_(budget, kBufferBytes / sizeof(uint32_t), "a window of a file"),
        block_(budget, CheckedReader::kBlockBytes, "a block of a file") {}

  // Returns the node, valid until the next call.
  voxdag_reader::Node node(uint32_t level, uint64_t offset);
  // Calls visit(node, words) for each wanted node. `words` begins at the node's first word and
  // contains at least all words of the node. `wanted` must be sorted by the offsets.
  template <class Visit>
  void for_each(uint32_t level, std::span<const WantedNode> wanted, Visit&& visit) {
    for_each(
        level, wanted, [](std::span<const uint32_t>) {}, visit);
  }
  // Like the other for_each(), but also calls ahead(words) for most nodes, so that ahead() can
  // prefetch memory that visit() will read. The call for a node comes eight nodes before visit() of
  // this node.
  template <class Ahead, class Visit>
  void for_each(uint32_t level, std::span<const WantedNode> wanted, Ahead&& ahead, Visit&& visit);

  // Return the node or the mask of the brick at the beginning of `words`. `offset`, its word offset
  // in the level, is only for the error message. Throw Error{kCorrupt} if no node or brick can
  // begin there.
  voxdag_reader::Node parse_node(uint32_t level, uint64_t offset,
                                 std::span<const uint32_t> words) const;
  uint64_t parse_brick(uint64_t offset, std::span<const uint32_t> words) const;

 private:
  // Reads a window that begins at the first of the wanted nodes. Returns the number of wanted nodes
  // in the window.
  size_t fill(uint32_t level, std::span<const WantedNode> wanted);
  [[noreturn]] void corrupt(uint32_t level, uint64_t offset) const;

  CheckedReader& source_;
  const CancelToken& cancel_;
  PageBuffer<uint32_t> buffer_;
  PageBuffer<std::byte> block_;
  uint64_t first_ = 0;  // offset of the window's first word
  uint64_t count_ = 0;  // words of the window
};

template <class Ahead, class Visit>
void NodeReader::for_each(uint32_t level, std::span<const WantedNode> wanted, Ahead&& ahead,
                          Visit&& visit) {
  constexpr size_t kAhead = 8;
  while (!wanted.empty()) {
    cancel_.check();
    const size_t count = fill(level, wanted);
    const std::span<const uint32_t> window(buffer_.data(), count_);
    for (size_t i = 0; i < count; ++i) {
      if (i + kAhead < count) ahead(window.subspan(wanted[i + kAhead].offset - first_));
      visit(wanted[i], window.subspan(wanted[i].offset - first_));
    }
    wanted = wanted.subspan(count);
  }
}

}  // namespace voxdag::query
