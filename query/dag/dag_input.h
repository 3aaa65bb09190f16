// Reads a global file through its mapping, and verifies every checksum block before the first use.
// Releases pages of the mapping when the process exceeds its memory limit. Not thread-safe. Throws
// Error{kCorrupt}, Error{kCanceled} and voxdag_reader::Error.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/base/popcount8.h"
#include "core/format/global/checked_blocks.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// An offset that stands for an empty cube, which has no node.
inline constexpr uint64_t kNoNode = ~uint64_t{0};

class DagInput {
 public:
  // `file` must outlive this object. `memory_bytes` is the limit of the process's resident memory.
  DagInput(const voxdag_reader::File& file, uint64_t memory_bytes, const CancelToken& cancel)
      : file_(file),
        memory_bytes_(memory_bytes),
        bytes_between_checks_(
            std::clamp(memory_bytes / 16, kMinBytesBetweenChecks, kMaxBytesBetweenChecks)),
        cancel_(cancel),
        blocks_(file) {}

  const voxdag_reader::File& file() const { return file_; }
  const voxdag_reader::Level& level(uint32_t level) const { return file_.level(level); }
  // Return the node or brick at a word offset.
  voxdag_reader::Node node(uint32_t level, uint64_t offset) {
    expect_intact(level, offset);
    return file_.node(level, offset);
  }
  uint64_t brick(uint64_t offset) {
    expect_intact(file_.brick_level(), offset);
    return file_.brick(offset);
  }
  // Returns words [first, first + count) of a level. The level must have these words.
  std::span<const uint32_t> words(uint32_t level, uint64_t first, uint64_t count) {
    const voxdag_reader::Level& from = file_.level(level);
    bytes(from.file_offset + sizeof(uint32_t) * first, sizeof(uint32_t) * count);
    return {from.words + first, count};
  }
  // Returns `count` bytes of the file from `offset` on. All of them must be between the header page
  // and the checksum table.
  std::span<const std::byte> bytes(uint64_t offset, uint64_t count) {
    const unsigned char* const begin = file_.data() + offset;
    blocks_.expect_intact(begin, count);
    touch(count);
    return std::as_bytes(std::span(begin, count));
  }
  [[noreturn]] void corrupt(uint32_t level, uint64_t offset, const char* what) const;

 private:
  friend class LevelCursor;
  // An upper estimate of the bytes that the system loads into memory for one access to the mapping.
  static constexpr uint64_t kVisitBytes = uint64_t{64} << 10;
  // A check of the resident memory takes as long as tens of accesses.
  static constexpr uint64_t kMinBytesBetweenChecks = uint64_t{8} << 20;
  static constexpr uint64_t kMaxBytesBetweenChecks = uint64_t{256} << 20;

  void expect_intact(uint32_t level, uint64_t offset) {
    const voxdag_reader::Level& nodes = file_.level(level);
    if (offset >= nodes.word_count) return;  // File::node() and brick() refuse the offset
    blocks_.expect_intact(
        nodes.words + offset,
        sizeof(uint32_t) * std::min(global_layout::kMaxNodeWords, nodes.word_count - offset));
    touch(kVisitBytes);
  }
  void touch(uint64_t bytes) {
    touched_bytes_ += bytes;
    if (touched_bytes_ > bytes_between_checks_) check();
  }
  void check();

  const voxdag_reader::File& file_;
  const uint64_t memory_bytes_;
  const uint64_t bytes_between_checks_;
  const CancelToken& cancel_;
  const CheckedBlocks blocks_;
  uint64_t touched_bytes_ = 0;  // bytes read since the last check of the memory
};

// Returns the offsets of a node's children by their index; kNoNode if a child does not exist. In a
// damaged file a pointer can equal kNoNode, or kNoNode - 1, which query/morphology reserves. Then
// the offset is another one that the level cannot have.
inline std::array<uint64_t, 8> children_by_index(const voxdag_reader::Node& node) {
  std::array<uint64_t, 8> children;
  int next = 0;
  for (size_t c = 0; c < 8; ++c)
    children[c] = node.child_mask >> c & 1 ? std::min(node.child(next++), kNoNode - 2) : kNoNode;
  return children;
}

// Visits the nodes of a level, or its bricks, in the order of the file.
class LevelCursor {
 public:
  LevelCursor(DagInput& input, uint32_t level)
      : input_(input),
        level_(level),
        words_(input.level(level)),
        is_brick_level_(level == input.file().brick_level()),
        wide_(!is_brick_level_ && input.level(level + 1).pointer_bits == 64) {
    load();
  }

  bool at_end() const { return offset_ >= words_.word_count; }
  uint64_t offset() const { return offset_; }
  // Returns the current node. Requires that the level has nodes.
  const voxdag_reader::Node& node() const { return node_; }
  // Returns the current brick. Requires that the level has bricks.
  uint64_t brick() const {
    return words_.words[offset_] | static_cast<uint64_t>(words_.words[offset_ + 1]) << 32;
  }
  // Returns the words of the current node or brick.
  std::span<const uint32_t> words() const { return {words_.words + offset_, size_}; }
  void next() {
    offset_ += size_;
    ++count_;
    load();
  }
  // True if the nodes of the level have 64-bit pointers.
  bool is_wide() const { return wide_; }
  // Returns the words of the level, from its beginning, whose checksums are verified. They include
  // the current node.
  std::span<const uint32_t> verified_words() const { return {words_.words, checked_}; }

 private:
  static constexpr uint64_t kChunkWords = uint64_t{1} << 16;

  void load() {
    if (at_end()) return expect_all_nodes();
    if (offset_ + global_layout::kMaxNodeWords > checked_) check_chunk();
    if (is_brick_level_) return load_brick();
    const uint32_t* const words = words_.words + offset_;
    const uint32_t mask = words[0];
    size_ = 1 + (static_cast<uint64_t>(popcount8(mask)) << wide_);
    if (mask == 0 || mask > 255 || size_ > words_.word_count - offset_)
      input_.file_.node(level_, offset_);  // throws
    node_ = {mask, words + 1, wide_};
  }
  void load_brick() {
    size_ = 2;
    if (offset_ + size_ > words_.word_count || brick() == 0)
      input_.corrupt(level_, offset_, "the brick has no voxels: expected at least one");
  }
  void check_chunk();
  void expect_all_nodes() const;

  DagInput& input_;
  const uint32_t level_;
  const voxdag_reader::Level words_;
  const bool is_brick_level_;
  const bool wide_;
  voxdag_reader::Node node_;
  uint64_t offset_ = 0;
  uint64_t size_ = 0;     // words of the current node
  uint64_t count_ = 0;    // nodes before the current one
  uint64_t checked_ = 0;  // words whose checksum blocks are verified
};

}  // namespace voxdag::query
