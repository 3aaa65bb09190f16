// Converts tables to level arrays, from the bricks up. Each level of nodes takes three passes:
//
//   1. Replace the child ids in the level's records by the children's positions in the array of the
//      level below. This pass visits the records in the order in which they were added, which is
//      also their order in memory.
//   2. Sort the slots of the level's hash table (node_table.h) in the total order (level_array.h).
//   3. Copy the records to the level's array in the order of the slots. Store in each record its
//      position in the array, for pass 1 of the level above.
#include <algorithm>
#include <cstring>

#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/node_hash.h"

namespace voxdag {
namespace {

constexpr size_t kPrefetchAhead = 12;  // in records

class LevelEmitter {
 public:
  LevelEmitter(SubDagTables& tables, const SubDagShape& shape, SubDagSink& sink)
      : tables_(tables), grid_levels_(shape.grid_levels), hash_bits_(shape.hash_bits), sink_(sink) {
    uint64_t max_nodes = 0, max_children = 0, max_hashes = tables.bricks().size();
    for (int s = kBrickLevels + 1; s <= tables.size_log2(); ++s) {
      max_nodes = std::max(max_nodes, tables.nodes(s).size());
      max_children = std::max(max_children, tables.nodes(s).total_children());
    }
    max_hashes = std::max(max_hashes, max_nodes);
    PooledMemory& memory = tables.memory();
    brick_places_ = PooledArray<uint32_t>(memory, tables.bricks().size());
    hashes_ = PooledArray<uint64_t>(memory, max_hashes);
    masks_ = PooledArray<uint8_t>(memory, max_nodes);
    children_ = PooledArray<uint32_t>(memory, max_children + 8);
  }

  SubDagSummary run() {
    SubDagSummary summary{tables_.counts().voxels, tables_.counts().nodes, tables_.bricks().size(),
                          0};
    if (hash_bits_ < 64) truncate_hashes();
    emit_bricks();
    summary.root_hash = truncate_hash(hash_brick(hashes_[0]), hash_bits_);
    for (int s = kBrickLevels + 1; s <= tables_.size_log2(); ++s) {
      emit_nodes(s);
      summary.dag_nodes += tables_.nodes(s).size();
      summary.root_hash = hashes_[0];
    }
    return summary;
  }

 private:
  // Replaces the hashes of all records by hashes of `hash_bits_` bits (--hash-bits), from the
  // bricks up: a parent is hashed from the truncated hashes of its children.
  void truncate_hashes() {
    PooledArray<uint64_t> brick_hashes(tables_.memory(), tables_.bricks().size());
    tables_.bricks().for_each([&](uint64_t mask, uint32_t id) {
      brick_hashes[id] = truncate_hash(hash_brick(mask), hash_bits_);
    });
    for (int s = kBrickLevels + 1; s <= tables_.size_log2(); ++s)
      tables_.nodes(s).for_each_record([&](NodeTable::Record record) {
        uint64_t hash = node_hash_begin(record.mask());
        for (int i = 0; i < record.child_count(); ++i) {
          const uint32_t child = record.children()[i];
          hash = node_hash_add(hash, s == kBrickLevels + 1
                                         ? brick_hashes[child]
                                         : tables_.nodes(s - 1).record(child).hash());
        }
        record.set_hash(truncate_hash(node_hash_end(hash), hash_bits_));
      });
  }

  void emit_bricks() {
    const std::span<const BrickTable::Slot> slots = tables_.bricks().sort_slots(hash_bits_);
    for (uint32_t i = 0; i < slots.size(); ++i) {
      hashes_[i] = slots[i].mask;
      brick_places_[slots[i].id] = i;
    }
    sink_.bricks({std::span(hashes_.data(), slots.size())});
  }

  void place_children(int size_log2) {
    NodeTable& table = tables_.nodes(size_log2);
    if (size_log2 == kBrickLevels + 1) {
      table.for_each_record([&](NodeTable::Record record) {
        for (int i = 0; i < record.child_count(); ++i)
          record.children()[i] = brick_places_[record.children()[i]];
      });
      return;
    }
    NodeTable& below = tables_.nodes(size_log2 - 1);
    table.for_each_record([&](NodeTable::Record record) {
      for (int i = 0; i < record.child_count(); ++i)
        record.children()[i] = below.record(record.children()[i]).place();
    });
  }

  void emit_nodes(int size_log2) {
    NodeTable& table = tables_.nodes(size_log2);
    place_children(size_log2);
    const std::span<const uint64_t> slots = table.sort_slots(hash_bits_ < 64);
    size_t at = 0;
    for (uint32_t i = 0; i < slots.size(); ++i) {
      if (i + kPrefetchAhead < slots.size())
        __builtin_prefetch(table.record(static_cast<uint32_t>(slots[i + kPrefetchAhead])).words, 1);
      NodeTable::Record record = table.record(static_cast<uint32_t>(slots[i]));
      hashes_[i] = record.hash();
      masks_[i] = static_cast<uint8_t>(record.mask());
      // Always copies eight children, because a copy of constant size needs no loop. The next node
      // overwrites the surplus. Records and `children_` have space for it.
      std::memcpy(&children_[at], record.children(), 8 * sizeof(uint32_t));
      at += record.child_count();
      record.set_place(i);
    }
    sink_.nodes({grid_levels_ - static_cast<uint32_t>(size_log2),
                 std::span(hashes_.data(), slots.size()), std::span(masks_.data(), slots.size()),
                 std::span(children_.data(), at)});
  }

  SubDagTables& tables_;
  const uint32_t grid_levels_;
  const uint32_t hash_bits_;
  SubDagSink& sink_;
  PooledArray<uint32_t> brick_places_;  // indexed by brick id
  PooledArray<uint64_t> hashes_;        // hashes of the level's nodes, or masks of the bricks
  PooledArray<uint8_t> masks_;
  PooledArray<uint32_t> children_;
};

}  // namespace

SubDagSummary emit_levels(SubDagTables& tables, const SubDagShape& shape, SubDagSink& sink) {
  if (tables.bricks().size() == 0) return {};
  return LevelEmitter(tables, shape, sink).run();
}

}  // namespace voxdag
