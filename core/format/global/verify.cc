#include "core/format/global/verify.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "core/base/error.h"
#include "core/base/host_device.h"
#include "core/base/page_buffer.h"
#include "core/base/popcount8.h"
#include "core/dag/level_array.h"
#include "core/dag/node_hash.h"
#include "core/format/checksum.h"
#include "core/format/global/global_layout.h"

namespace voxdag {

using namespace global_layout;

namespace {

constexpr uint64_t kNodesPerCheck = uint64_t{1} << 16;  // of the cancel token

// Maps the word offset where a node of a level of the global file begins to its index in the level.
// Takes 2 bits per word. Immutable after construction.
class NodeIndex {
 public:
  static constexpr uint64_t kNone = ~uint64_t{0};

  NodeIndex() = default;
  // Walks the words of the level, whose children are `wide` or not. Throws Error{kCorrupt}
  // beginning with `where` unless every child mask is 1 to 255, the last node ends with the level,
  // and there are as many nodes as the header says.
  NodeIndex(const voxdag_reader::Level& level, bool bricks, bool wide, MemoryBudget& budget,
            const std::string& where);

  // The index of the node that begins at `offset`; kNone if none does.
  uint64_t find(uint64_t offset) const {
    if (offset >= words_) return kNone;
    if (bricks_) return offset % 2 == 0 ? offset / 2 : kNone;
    const uint64_t bits = starts_[offset / 64], bit = uint64_t{1} << offset % 64;
    return bits & bit
               ? nodes_before_[offset / 64] + static_cast<uint64_t>(popcount64(bits & (bit - 1)))
               : kNone;
  }

 private:
  bool bricks_ = false;
  uint64_t words_ = 0;
  PageBuffer<uint64_t> starts_;        // one bit per word: a node begins here
  PageBuffer<uint64_t> nodes_before_;  // for each 64 words
};

NodeIndex::NodeIndex(const voxdag_reader::Level& level, bool bricks, bool wide,
                     MemoryBudget& budget, const std::string& where)
    : bricks_(bricks), words_(level.word_count) {
  const auto miscounted = [&](uint64_t nodes) {
    throw Error(ErrorCode::kCorrupt, where + ": its words hold " + std::to_string(nodes) +
                                         " nodes, expected " + std::to_string(level.node_count));
  };
  if (bricks) {
    if (words_ != 2 * level.node_count) miscounted(words_ / 2);
    return;
  }
  starts_ = PageBuffer<uint64_t>(budget, words_ / 64 + 1, "an index of nodes");
  nodes_before_ = PageBuffer<uint64_t>(budget, words_ / 64 + 1, "an index of nodes");
  uint64_t nodes = 0, at = 0;
  for (; at < words_; ++nodes) {
    const uint32_t mask = level.words[at];
    if (mask == 0 || mask > 255)
      throw Error(ErrorCode::kCorrupt, where + ", word " + std::to_string(at) + ": child mask " +
                                           std::to_string(mask) + ", expected 1 to 255");
    starts_[at / 64] |= uint64_t{1} << at % 64;
    at += 1 + (uint64_t{kPopcount8[mask]} << wide);
  }
  if (at != words_)
    throw Error(ErrorCode::kCorrupt, where + ": its last node ends at word " + std::to_string(at) +
                                         ", the level at word " + std::to_string(words_));
  if (nodes != level.node_count) miscounted(nodes);
  uint64_t before = 0;
  for (size_t i = 0; i < starts_.size(); ++i) {
    nodes_before_[i] = before;
    before += static_cast<uint64_t>(popcount64(starts_[i]));
  }
}

// Whether `b` is after `a` in the total order.
bool follows(uint64_t hash_a, const voxdag_reader::Node& a, uint64_t hash_b,
             const voxdag_reader::Node& b) {
  if (hash_a != hash_b) return hash_a < hash_b;
  if (a.child_mask != b.child_mask) return a.child_mask < b.child_mask;
  for (int c = 0; c < kPopcount8[a.child_mask]; ++c)
    if (a.child(c) != b.child(c)) return a.child(c) < b.child(c);
  return false;
}

class Verifier {
 public:
  Verifier(const voxdag_reader::File& file, MemoryBudget& budget, Progress& progress,
           const CancelToken& cancel)
      : file_(file),
        budget_(budget),
        progress_(progress),
        cancel_(cancel),
        indexes_(file.brick_level() + 1) {}

  void run() {
    check_header();
    check_blocks();
    check_padding();
    if (!file_.empty()) {
      progress_.begin_stage("verify nodes", file_.dag_nodes(), "nodes");
      check_bricks();
      for (uint32_t level = file_.brick_level(); level-- > 0;) check_nodes(level);
      if (file_.level(0).node_count != 1)
        broken(where(0), std::to_string(file_.level(0).node_count) + " roots, expected 1");
      progress_.end_stage();
    }
    check_counts();
  }

 private:
  [[noreturn]] void broken(const std::string& where, const std::string& what) const {
    throw Error(ErrorCode::kCorrupt, where + ": " + what);
  }
  std::string where(uint32_t level) const {
    return file_.path() + ": level " + std::to_string(level);
  }
  std::string where(uint32_t level, uint64_t word) const {
    return where(level) + ", word " + std::to_string(word);
  }
  // Called before node `i` of `count`: reports the nodes up to the next check of the cancel token.
  void advance(uint64_t i, uint64_t count) {
    if (i % kNodesPerCheck != 0) return;
    cancel_.check();
    progress_.advance(std::min(kNodesPerCheck, count - i));
  }

  void check_header() const;
  void check_blocks();
  void check_padding() const;
  void check_zeros(uint64_t begin, uint64_t end, const std::string& what) const;
  void check_bricks();
  void check_nodes(uint32_t level);
  bool wide_children(uint32_t level) const { return file_.level(level + 1).pointer_bits == 64; }
  void check_all_used(uint32_t level) const;
  void check_counts() const;

  const voxdag_reader::File& file_;
  MemoryBudget& budget_;
  Progress& progress_;
  const CancelToken& cancel_;
  std::vector<NodeIndex> indexes_;  // of the levels checked so far
  PageBuffer<uint64_t> hashes_;     // truncated, of the level checked last
  PageBuffer<uint8_t> used_;        // by the level above it
};

void Verifier::check_zeros(uint64_t begin, uint64_t end, const std::string& what) const {
  for (uint64_t at = begin; at < end; ++at)
    if (file_.data()[at] != 0)
      broken(file_.path() + ": byte " + std::to_string(at), what + ", expected 0");
}

// The reader checked the fields that it needs; the others have fixed values.
void Verifier::check_header() const {
  uint32_t node_order;
  std::memcpy(&node_order, file_.data() + kNodeOrderAt, sizeof(node_order));
  if (node_order != kNodeOrderByHash)
    throw Error(ErrorCode::kUnsupportedVersion,
                file_.path() + ": node order " + std::to_string(node_order) + ", expected 1");
  check_zeros(kAttributeCountAt, kLevelsAt, "attribute sections are reserved");
  for (size_t level = 0; level < kMaxLevels; ++level) {
    const size_t entry = kLevelsAt + level * kLevelEntryBytes;
    const bool there = level <= file_.brick_level();
    const size_t last = file_.version() == kVersion ? entry + 24 : entry + 28;
    check_zeros(there ? last : entry, entry + kLevelEntryBytes, "a reserved field");
  }
  const bool has_features = file_.version() != kVersion;
  check_zeros(kAttributesAt, kFeaturesAt, "reserved");
  check_zeros(has_features ? kReservedAt : kFeaturesAt, kHeaderChecksumAt, "reserved");
}

void Verifier::check_blocks() {
  const uint64_t table = file_.checksum_table_offset();
  progress_.begin_stage("verify checksums", table - kPageBytes, "bytes");
  for (uint64_t begin = kPageBytes, block = 0; begin < table;
       begin += kChecksumBlockBytes, ++block) {
    const uint64_t size = std::min(kChecksumBlockBytes, table - begin);
    uint64_t expected;
    std::memcpy(&expected, file_.data() + table + 8 * block, sizeof(expected));
    if (checksum64(std::as_bytes(std::span(file_.data() + begin, size))) != expected)
      broken(file_.path() + ": bytes " + std::to_string(begin) + " to " +
                 std::to_string(begin + size - 1),
             "the block fails its checksum");
    progress_.advance(size);
    cancel_.check();
  }
  progress_.end_stage();
}

void Verifier::check_padding() const {
  if (file_.empty()) return;
  for (uint32_t level = 0; level <= file_.brick_level(); ++level) {
    const voxdag_reader::Level& l = file_.level(level);
    const uint64_t end = l.file_offset + sizeof(uint32_t) * l.word_count;
    check_zeros(end, round_up_to_page(end), "padding after level " + std::to_string(level));
  }
}

void Verifier::check_bricks() {
  const uint32_t level = file_.brick_level();
  const voxdag_reader::Level& bricks = file_.level(level);
  indexes_[level] = NodeIndex(bricks, true, false, budget_, where(level));
  hashes_ = PageBuffer<uint64_t>(budget_, bricks.node_count, "hashes of a level");
  uint64_t last_mask = 0;
  for (uint64_t i = 0; i < bricks.node_count; ++i) {
    advance(i, bricks.node_count);
    const uint64_t mask = file_.brick(2 * i);
    const uint64_t hash = truncate_hash(hash_brick(mask), file_.hash_bits());
    if (mask == 0) broken(where(level, 2 * i), "the brick is empty");
    if (i > 0 && (hash < hashes_[i - 1] || (hash == hashes_[i - 1] && mask <= last_mask)))
      broken(where(level, 2 * i), "the brick does not follow the one before it by hash and mask");
    hashes_[i] = hash;
    last_mask = mask;
  }
}

void Verifier::check_nodes(uint32_t level) {
  const voxdag_reader::Level& nodes = file_.level(level);
  const NodeIndex& below = indexes_[level + 1];
  const bool wide = wide_children(level);
  indexes_[level] = NodeIndex(nodes, false, wide, budget_, where(level));
  PageBuffer<uint64_t> hashes(budget_, nodes.node_count, "hashes of a level");
  used_ = PageBuffer<uint8_t>(budget_, hashes_.size(), "parents of a level");
  voxdag_reader::Node previous;
  uint64_t at = 0;
  for (uint64_t i = 0; i < nodes.node_count; ++i) {
    advance(i, nodes.node_count);
    const voxdag_reader::Node node{nodes.words[at], nodes.words + at + 1, wide};
    const int children = kPopcount8[node.child_mask];
    uint64_t child_hashes[8];
    for (int c = 0; c < children; ++c) {
      const uint64_t child = below.find(node.child(c));
      if (child == NodeIndex::kNone)
        broken(where(level, at + 1 + (static_cast<uint64_t>(c) << wide)),
               "a child at word " + std::to_string(node.child(c)) + ", where no node of level " +
                   std::to_string(level + 1) + " begins");
      child_hashes[c] = hashes_[child];
      used_[child] = 1;
    }
    hashes[i] = truncate_hash(hash_node(node.child_mask, child_hashes), file_.hash_bits());
    if (i > 0 && !follows(hashes[i - 1], previous, hashes[i], node))
      broken(where(level, at), "the node does not follow the one before it in the total order");
    previous = node;
    at += 1 + (static_cast<uint64_t>(children) << wide);
  }
  check_all_used(level + 1);
  hashes_ = std::move(hashes);
}

void Verifier::check_all_used(uint32_t level) const {
  for (uint64_t i = 0; i < used_.size(); ++i)
    if (!used_[i]) broken(where(level), "node " + std::to_string(i) + " has no parent");
}

// Counts how often each node occurs in the octree, from the root down, and from that the voxels.
void Verifier::check_counts() const {
  uint64_t svo_nodes = 0, voxels = 0;
  PageBuffer<uint64_t> times(budget_, file_.empty() ? 0 : 1, "counts of a level");
  if (!file_.empty()) times[0] = 1;
  for (uint32_t level = 0; level < file_.brick_level() && !file_.empty(); ++level) {
    const NodeIndex& below = indexes_[level + 1];
    PageBuffer<uint64_t> child_times(budget_, file_.level(level + 1).node_count,
                                     "counts of a level");
    const bool wide = wide_children(level);
    const uint32_t* word = file_.level(level).words;
    for (uint64_t i = 0; i < times.size(); ++i) {
      svo_nodes += times[i];
      const voxdag_reader::Node node{*word, word + 1, wide};
      const int children = kPopcount8[node.child_mask];
      for (int c = 0; c < children; ++c) child_times[below.find(node.child(c))] += times[i];
      word += 1 + (static_cast<uint64_t>(children) << wide);
    }
    times = std::move(child_times);
    cancel_.check();
  }
  for (uint64_t i = 0; i < times.size(); ++i) {
    svo_nodes += times[i];
    voxels += times[i] * static_cast<uint64_t>(popcount64(file_.brick(2 * i)));
  }
  if (voxels != file_.voxels())
    broken(file_.path() + ": header",
           std::to_string(file_.voxels()) + " voxels, the DAG has " + std::to_string(voxels));
  if (svo_nodes != file_.svo_nodes())
    broken(file_.path() + ": header", std::to_string(file_.svo_nodes()) +
                                          " octree nodes, the DAG has " +
                                          std::to_string(svo_nodes));
}

}  // namespace

void verify_global_file(const voxdag_reader::File& file, MemoryBudget& budget, Progress& progress,
                        const CancelToken& cancel) {
  Verifier(file, budget, progress, cancel).run();
}

}  // namespace voxdag
