// Records that pass between the levels while two DAGs are combined.
//
// The pairs of a level are numbered in the order of their offsets `a`, then `b` (NodePair). A
// *place* is a child of a pair: 8 * number of the pair + index of the child.
#pragma once

#include <cstdint>
#include <tuple>

#include "core/dag/consing/sub_dag_tables.h"
#include "query/combine/operation.h"
#include "query/combine/row.h"

namespace voxdag::query {

constexpr uint64_t place_of(uint64_t pair, int child) {
  return 8 * pair + static_cast<uint64_t>(child);
}
constexpr uint64_t pair_of(uint64_t place) { return place / 8; }
constexpr int child_of(uint64_t place) { return static_cast<int>(place % 8); }

// A place whose result is the result of a pair that is not known yet.
struct PairRequest {
  NodePair cubes;
  uint64_t place = 0;
  friend auto operator<=>(const PairRequest&, const PairRequest&) = default;
};

// A place whose result is the result of the pair `pair` of the next finer level.
struct PairUse {
  uint64_t pair = 0;
  uint64_t place = 0;
};

// A place whose result is a node of one of the files.
struct NodeUse {
  uint64_t offset = 0;
  uint64_t place = 0;
  friend auto operator<=>(const NodeUse&, const NodeUse&) = default;
};

// A place whose counts change by `sign` times the counts of a node of one of the files.
struct CountUse {
  uint64_t offset = 0;
  uint64_t place = 0;
  int64_t sign = 1;
  friend auto operator<=>(const CountUse&, const CountUse&) = default;
};

// A change of the counts of a place or of a pair, whose number is `key`, modulo 2^64.
struct KeyedCounts {
  uint64_t key = 0;
  OctreeCounts counts;
  friend bool operator<(const KeyedCounts& a, const KeyedCounts& b) { return a.key < b.key; }
};

// A node of the new file.
struct NewNode {
  uint64_t position = 0;  // word offset in its level
  uint64_t hash = 0;
};

// The result of a place or of a pair, whose number is `key`.
struct KeyedNode {
  uint64_t key = 0;
  NewNode node;
  friend bool operator<(const KeyedNode& a, const KeyedNode& b) { return a.key < b.key; }
};

// A row that is made from a pair.
struct PairRow {
  Row row;
  uint64_t pair = 0;
  friend bool operator<(const PairRow& a, const PairRow& b) {
    const int order = compare_rows(a.row, b.row);
    return order != 0 ? order < 0 : a.pair < b.pair;
  }
};

}  // namespace voxdag::query
