#include "core/format/verify/verify.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <vector>

#include "core/base/error.h"
#include "core/base/host_device.h"
#include "core/base/page_buffer.h"
#include "core/base/parallel_for.h"
#include "core/base/popcount8.h"
#include "core/color/cell_values.h"
#include "core/dag/level_array.h"
#include "core/dag/node_hash.h"
#include "core/format/global/checked_blocks.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/node_index.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/verify_colors.h"
#include "core/format/verify/verify_order.h"

namespace voxdag {

using namespace global_layout;

namespace {

constexpr uint64_t kBlocksPerItem = 64;  // checksum blocks, 4 MiB together

class Verifier {
 public:
  Verifier(const voxdag_reader::File& file, unsigned threads, MemoryBudget& budget,
           Progress& progress, const CancelToken& cancel, uint64_t narrow_words, bool is_quick)
      : file_(file),
        threads_(threads),
        budget_(budget),
        progress_(progress),
        cancel_(cancel),
        narrow_words_(narrow_words),
        is_quick_(is_quick),
        indexes_(file.brick_level() + 1) {}

  void run() {
    check_header();
    check_blocks();
    check_padding();
    if (!file_.empty()) {
      progress_.begin_stage("verify nodes", file_.dag_nodes(), "nodes");
      for (uint32_t level = file_.brick_level() + 1; level-- > 0;) check_level(level);
      if (file_.level(0).node_count != 1)
        broken(where(0), std::to_string(file_.level(0).node_count) + " roots, expected 1");
      progress_.end_stage();
    }
    check_counts();
    verify_colors(file_, threads_, progress_, cancel_);
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

  void check_header() const;
  void check_attributes(bool has_attributes) const;
  void check_section(size_t entry, Attribute attribute) const;
  void check_blocks();
  void check_padding() const;
  void check_zeros(uint64_t begin, uint64_t end, const std::string& what) const;
  void check_level(uint32_t level);
  void check_span(uint32_t level, uint64_t span, PageBuffer<uint64_t>& hashes);
  uint64_t brick_hash(uint64_t at) const;
  uint64_t node_hash(uint32_t level, const NodeWithChildren& parent) const;
  uint64_t hash_at(uint32_t level, uint64_t at) const;
  void check_counts() const;
  void count_children(uint32_t level, uint64_t span, const PageBuffer<uint64_t>& times,
                      PageBuffer<uint64_t>& child_times) const;

  Pointers pointers(uint32_t level) const {
    if (level == file_.brick_level()) return Pointers::kNone;
    return file_.level(level + 1).pointer_bits == 64 ? Pointers::kWide : Pointers::kNarrow;
  }
  bool is_by_hash() const { return NodeOrder{file_.node_order()} == NodeOrder::kByHash; }
  // Returns the node that begins at word `at`.
  voxdag_reader::Node node(uint32_t level, uint64_t at) const {
    return verified_node(file_, level, at);
  }

  const voxdag_reader::File& file_;
  const unsigned threads_;
  MemoryBudget& budget_;
  Progress& progress_;
  const CancelToken& cancel_;
  const uint64_t narrow_words_;
  const bool is_quick_;
  std::vector<NodeIndex> indexes_;  // indexes of the levels checked so far
  PageBuffer<uint64_t> hashes_;     // truncated hashes of the nodes of the level checked last
};

void Verifier::check_zeros(uint64_t begin, uint64_t end, const std::string& what) const {
  for (uint64_t at = begin; at < end; ++at)
    if (file_.data()[at] != 0)
      broken(file_.path() + ": byte " + std::to_string(at),
             what + " is " + std::to_string(file_.data()[at]) + ", expected 0");
}

// The reader has checked the fields that it uses. This function checks all other fields, which must
// have fixed values.
void Verifier::check_header() const {
  if (*name_of(NodeOrder{file_.node_order()}) == 0)
    throw Error(
        ErrorCode::kUnsupportedVersion,
        file_.path() + ": node order " + std::to_string(file_.node_order()) + ", expected 1 or 2");
  for (size_t level = 0; level < kMaxLevels; ++level) {
    const size_t entry = kLevelsAt + level * kLevelEntryBytes;
    const bool there = level <= file_.brick_level();
    const size_t last = file_.version() == kVersion ? entry + 24 : entry + 28;
    check_zeros(there ? last : entry, entry + kLevelEntryBytes, "a reserved byte");
  }
  const bool has_features = file_.version() != kVersion;
  bool any_wide = false;
  for (uint32_t level = 0; level <= file_.brick_level() && !file_.empty(); ++level) {
    const voxdag_reader::Level& words = file_.level(level);
    const uint32_t bits = words.word_count > narrow_words_ ? 64 : 32;
    if (words.pointer_bits != bits)
      broken(where(level), "pointers of " + std::to_string(words.pointer_bits) + " bits into " +
                               std::to_string(words.word_count) + " words, expected " +
                               std::to_string(bits));
    any_wide |= bits == 64;
  }
  uint64_t features = 0;
  if (has_features) std::memcpy(&features, file_.data() + kFeaturesAt, sizeof(features));
  if (has_features && features == 0)
    broken(file_.path() + ": header",
           "the version is 2, but no feature bit is set, expected version 1");
  if (has_features && any_wide != ((features & kWideLevels) != 0))
    broken(file_.path() + ": header", "feature bits " + std::to_string(features) +
                                          ", expected the bit of wide levels to be " +
                                          (any_wide ? "1" : "0"));
  check_attributes((features & kAttributes) != 0);
  check_zeros(has_features ? kReservedAt : kFeaturesAt, kHeaderChecksumAt, "a reserved byte");
}

// Checks the attribute table. Sections of kinds that this program does not know are not valid.
void Verifier::check_attributes(bool has_attributes) const {
  if (!has_attributes) check_zeros(kAttributeCountAt, kLevelsAt, "attribute sections are reserved");
  uint64_t count;
  std::memcpy(&count, file_.data() + kAttributeCountAt, sizeof(count));
  const std::vector<Attribute> kinds = attributes_of(file_).list();
  if (count != kinds.size())
    broken(file_.path() + ": header", std::to_string(count) + " attribute sections, expected " +
                                          std::to_string(kinds.size()) +
                                          ", the number of known sections in the file");
  if (has_attributes == kinds.empty())
    broken(file_.path() + ": header",
           "the feature bit of attributes does not match the attribute table, expected it to be 1 "
           "if and only if there are attribute sections");
  for (size_t i = 0; i < kinds.size(); ++i)
    check_section(kAttributesAt + i * kAttributeEntryBytes, kinds[i]);
  check_zeros(kAttributesAt + kinds.size() * kAttributeEntryBytes, kFeaturesAt, "a reserved byte");
}

// `entry` is the byte offset of the section's entry in the header page. Checks the entry, the
// section's list of names, and its padding.
void Verifier::check_section(size_t entry, Attribute attribute) const {
  const auto field = [&](size_t at) {
    uint64_t value;
    std::memcpy(&value, file_.data() + entry + at, sizeof(value));
    return value;
  };
  const std::string plural = traits_of(attribute).plural;
  const voxdag_reader::ColorSection& section = section_of(file_, attribute);
  uint64_t cells = 0, finest_cells = 0;
  for (uint32_t t = 0; t < section.tier_count(); ++t) cells += section.tier(t).cell_count;
  for (uint64_t i = 0; i < section.tier(0).region_count; ++i) {
    voxdag_reader::ColorRegion region;
    if (!voxdag_reader::ColorSection::region(section.tier(0), i, region))
      broken(file_.path() + ": " + plural,
             "region " + std::to_string(i) +
                 " is damaged: expected counts and an offset within the section");
    finest_cells += region.counts[0];
  }
  if (field(kAttributeCellsAt) != cells || field(kAttributeFinestCellsAt) != finest_cells)
    broken(file_.path() + ": header",
           "the attribute table has " + std::to_string(field(kAttributeCellsAt)) + " " + plural +
               ", the section has " + std::to_string(cells) + "; " +
               std::to_string(field(kAttributeFinestCellsAt)) +
               " of them on the finest level, the section has " + std::to_string(finest_cells));
  // End of the section, without the padding up to the next page.
  const uint64_t end = field(kAttributeOffsetAt) + field(kAttributeBytesAt);
  if (traits_of(attribute).has_names()) {
    const voxdag_reader::ColorTier& last = section.tier(section.tier_count() - 1);
    const uint64_t names = static_cast<uint64_t>(last.directory - file_.data()) +
                           32 * last.region_count + list_bytes(section.names());
    const uint64_t tiers = end - 32 * section.tier_count();
    if (tiers != (names + 15) / 16 * 16 || !section.names().back().empty())
      broken(file_.path() + ": " + plural,
             "the list of names does not end as it must, expected an empty last name, and the tier "
             "table at the next multiple of 16 bytes");
    check_zeros(names, tiers, "padding after the names of " + plural);
  }
  check_zeros(end, round_up_to_page(end), "padding after the " + plural);
  check_zeros(entry + kAttributeReservedAt, entry + kAttributeEntryBytes, "a reserved byte");
}

void Verifier::check_blocks() {
  const uint64_t bytes = file_.checksum_table_offset() - kPageBytes;
  const CheckedBlocks checked(file_);
  const uint64_t blocks = checked.count();
  progress_.begin_stage("verify checksums", bytes, "bytes");
  parallel_for(
      threads_, (blocks + kBlocksPerItem - 1) / kBlocksPerItem, [&](unsigned, size_t item) {
        const uint64_t first = item * kBlocksPerItem;
        const uint64_t end = std::min(first + kBlocksPerItem, blocks);
        for (uint64_t block = first; block < end; ++block) checked.compare(block);
        progress_.advance(std::min(end * kChecksumBlockBytes, bytes) - first * kChecksumBlockBytes);
        cancel_.check();
      });
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

uint64_t Verifier::brick_hash(uint64_t at) const {
  return truncate_hash(hash_brick(file_.brick(at)), file_.hash_bits());
}

// Returns the hash of a node. Throws Error if one of its pointers does not lead to a node.
uint64_t Verifier::node_hash(uint32_t level, const NodeWithChildren& parent) const {
  uint64_t child_hashes[8];
  for (int c = 0; c < parent.child_count(); ++c) {
    const uint64_t child = parent.children[static_cast<size_t>(c)];
    if (child == NodeIndex::kNone)
      broken(where(level, parent.at + 1 + (static_cast<uint64_t>(c) << parent.node.wide)),
             "a child at word " + std::to_string(parent.node.child(c)) +
                 ", where no node of level " + std::to_string(level + 1) + " begins");
    child_hashes[c] = hashes_[child];
  }
  return truncate_hash(hash_node(parent.node.child_mask, parent.child_count(), child_hashes),
                       file_.hash_bits());
}

uint64_t Verifier::hash_at(uint32_t level, uint64_t at) const {
  if (level == file_.brick_level()) return brick_hash(at);
  NodeWithChildren parent{.at = at, .node = node(level, at)};
  for (int c = 0; c < parent.child_count(); ++c)
    parent.children[static_cast<size_t>(c)] = indexes_[level + 1].find(parent.node.child(c));
  return node_hash(level, parent);
}

// Computes the hashes of the nodes in a span and checks their order. The first node is compared
// with the last node before the span, whose hash is computed again, because another thread may be
// checking that span.
void Verifier::check_span(uint32_t level, uint64_t span, PageBuffer<uint64_t>& hashes) {
  const NodeIndex& index = indexes_[level];
  const bool bricks = level == file_.brick_level();
  uint64_t previous = span == 0 ? NodeIndex::kNone : index.last_before(span);
  uint64_t previous_hash = span == 0 ? 0 : hash_at(level, previous);
  uint64_t nodes = 0;
  const auto check_order = [&](uint64_t at, uint64_t hash) {
    const auto in_order = [&] {
      if (hash != previous_hash) return previous_hash < hash;
      return is_node_less(file_, level, previous, at);
    };
    if (is_by_hash() && previous != NodeIndex::kNone && !in_order())
      broken(where(level, at), bricks
                                   ? "the brick does not follow the one before it by hash and mask"
                                   : "the node does not follow the one before it in the total "
                                     "order of nodes (docs/format.md)");
    previous = at;
    previous_hash = hash;
    ++nodes;
  };
  if (bricks)
    index.visit_span(span, [&](uint64_t i, uint64_t at) {
      if (file_.brick(at) == 0)
        broken(where(level, at), "the brick is empty: expected at least one voxel");
      check_order(at, hashes[i] = brick_hash(at));
    });
  else
    visit_span_with_children(
        index, span, indexes_[level + 1], [&](uint64_t at) { return node(level, at); },
        [&](uint64_t child) { __builtin_prefetch(&hashes_[child]); },
        [&](const NodeWithChildren& parent) {
          check_order(parent.at, hashes[parent.index] = node_hash(level, parent));
        });
  cancel_.check();
  progress_.advance(nodes);
}

void Verifier::check_level(uint32_t level) {
  const voxdag_reader::Level& nodes = file_.level(level);
  indexes_[level] = NodeIndex(nodes, pointers(level), threads_, budget_, cancel_, where(level));
  PageBuffer<uint64_t> hashes(budget_, nodes.node_count, "hashes of a level");
  parallel_for(threads_, indexes_[level].span_count(),
               [&](unsigned, size_t span) { check_span(level, span, hashes); });
  if (!is_by_hash()) {
    if (level < file_.brick_level()) expect_first_parents(file_, level, indexes_[level], cancel_);
    if (!is_quick_)
      expect_unique({file_, level, indexes_[level], hashes}, threads_, budget_, cancel_);
  }
  hashes_ = std::move(hashes);
}

// Counts how often the children of a span's nodes occur in the octree. For each child of each node,
// adds the node's number of occurrences (in `times`) to the child's (in `child_times`).
void Verifier::count_children(uint32_t level, uint64_t span, const PageBuffer<uint64_t>& times,
                              PageBuffer<uint64_t>& child_times) const {
  visit_span_with_children(
      indexes_[level], span, indexes_[level + 1], [&](uint64_t at) { return node(level, at); },
      [&](uint64_t child) { __builtin_prefetch(&child_times[child], 1); },
      [&](const NodeWithChildren& parent) {
        for (int c = 0; c < parent.child_count(); ++c)
          std::atomic_ref(child_times[parent.children[static_cast<size_t>(c)]])
              .fetch_add(times[parent.index], std::memory_order_relaxed);
      });
}

// Checks the numbers of voxels and octree nodes in the header. To compute these numbers, counts the
// occurrences of each node in the octree, from the root down. Throws Error if a node does not
// occur.
void Verifier::check_counts() const {
  std::atomic<uint64_t> svo_nodes = 0, voxels = 0;
  PageBuffer<uint64_t> times(budget_, file_.empty() ? 0 : 1, "counts of a level");
  if (!file_.empty()) times[0] = 1;
  for (uint32_t level = 0; level <= file_.brick_level() && !file_.empty(); ++level) {
    const bool bricks = level == file_.brick_level();
    PageBuffer<uint64_t> child_times(budget_, bricks ? 0 : file_.level(level + 1).node_count,
                                     "counts of a level");
    parallel_for(threads_, indexes_[level].span_count(), [&](unsigned, size_t span) {
      cancel_.check();
      uint64_t span_nodes = 0, span_voxels = 0;
      indexes_[level].visit_span(span, [&](uint64_t i, uint64_t at) {
        if (times[i] == 0)
          broken(where(level),
                 "node " + std::to_string(i) + " has no parent: expected at least one");
        span_nodes += times[i];
        if (bricks) span_voxels += times[i] * static_cast<uint64_t>(popcount64(file_.brick(at)));
      });
      if (!bricks) count_children(level, span, times, child_times);
      svo_nodes += span_nodes;
      voxels += span_voxels;
    });
    times = std::move(child_times);
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

void verify_global_file(const voxdag_reader::File& file, unsigned threads, MemoryBudget& budget,
                        Progress& progress, const CancelToken& cancel, uint64_t narrow_words,
                        bool is_quick) {
  Verifier(file, threads, budget, progress, cancel, narrow_words, is_quick).run();
}

}  // namespace voxdag
