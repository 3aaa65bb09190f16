#include "core/dag/consing/sub_dag_tables.h"

#include "core/dag/consing/consing_memory.h"
#include "core/dag/node_hash.h"

namespace voxdag {
namespace {

constexpr uint64_t kBytesPerEntry = 80;  // upper bound per entry of a table, including its record

}  // namespace

SubDagTables::SubDagTables(PooledMemory& memory, int size_log2, const TableSizes& expected)
    : memory_(memory), bricks_(memory) {
  // If the cube is smaller than expected, a part of the reserved tables remains unused. So at most
  // a quarter of the free memory (table_bytes()) is reserved.
  uint64_t fits_budget = ConsingMemory::table_bytes(memory.budget.available());
  const auto reserve = [&](auto& table, int s) {
    const uint64_t bytes = expected.entries[s] * kBytesPerEntry;
    if (bytes == 0 || bytes > fits_budget) return;
    fits_budget -= bytes;
    table.reserve(expected.entries[s]);
  };
  reserve(bricks_, kBrickLevels);
  for (int s = kBrickLevels + 1; s <= size_log2; ++s) reserve(nodes_.emplace_back(memory), s);
}

TableSizes SubDagTables::sizes() const {
  TableSizes sizes;
  sizes.entries[kBrickLevels] = bricks_.size();
  for (size_t i = 0; i < nodes_.size(); ++i) sizes.entries[kBrickLevels + 1 + i] = nodes_[i].size();
  return sizes;
}

NodeRef SubDagTables::add_brick(uint64_t mask) {
  if (mask == 0) return {};
  counts_ += {1, static_cast<uint64_t>(popcount64(mask))};
  bricks_.reserve(1);
  const uint64_t hash = hash_brick(mask);
  return {hash, bricks_.find_or_add(mask, hash), true};
}

NodeRef SubDagTables::add_node(int size_log2, const NodeRef (&children)[8]) {
  uint32_t mask = 0, ids[8] = {};
  uint64_t hashes[8];
  int count = 0;
  for (int c = 0; c < 8; ++c) {
    if (!children[c].exists) continue;
    mask |= 1u << c;
    ids[count] = children[c].id;
    hashes[count++] = children[c].hash;
  }
  if (count == 0) return {};
  ++counts_.nodes;
  NodeTable& table = nodes(size_log2);
  table.reserve(1);
  const uint64_t hash = hash_node(mask, count, hashes);
  return {hash, table.find_or_add(hash, mask, ids, count), true};
}

}  // namespace voxdag
