// The set operations of combine(): the result of two bricks, and the pairs of cubes whose result is
// known without a look at their children.
#pragma once

#include <cstdint>

#include "query/dag/dag_input.h"

namespace voxdag::query {

enum class Operation { kUnion, kMinus, kAnd, kXor };

// The result of combining two cubes: nothing, the first file's cube, the second file's cube, or
// unknown until their children are combined.
enum class Outcome { kEmpty, kA, kB, kUnknown };

// The word offsets of two cubes of the same level, one of each file.
struct NodePair {
  uint64_t a = kNoNode;
  uint64_t b = kNoNode;
  friend auto operator<=>(const NodePair&, const NodePair&) = default;
};

constexpr uint64_t combine_bricks(Operation operation, uint64_t a, uint64_t b) {
  switch (operation) {
    case Operation::kUnion:
      return a | b;
    case Operation::kMinus:
      return a & ~b;
    case Operation::kAnd:
      return a & b;
    case Operation::kXor:
      break;
  }
  return a ^ b;
}

// Returns the result of two cubes of which at least one is empty. An empty cube is like a brick
// without voxels, so the operation on bits tells whether the other cube remains.
constexpr Outcome outcome_of_empty(Operation operation, const NodePair& cubes) {
  if (cubes.a != kNoNode) return combine_bricks(operation, 1, 0) ? Outcome::kA : Outcome::kEmpty;
  if (cubes.b != kNoNode) return combine_bricks(operation, 0, 1) ? Outcome::kB : Outcome::kEmpty;
  return Outcome::kEmpty;
}

// Returns the result of two cubes. `full` has the word offsets of the nodes of the same level in
// which all voxels are set.
constexpr Outcome outcome_of(Operation operation, const NodePair& cubes, const NodePair& full) {
  if (cubes.a == kNoNode || cubes.b == kNoNode) return outcome_of_empty(operation, cubes);
  const bool a_is_full = cubes.a == full.a, b_is_full = cubes.b == full.b;
  switch (operation) {
    case Operation::kUnion:
      return a_is_full ? Outcome::kA : b_is_full ? Outcome::kB : Outcome::kUnknown;
    case Operation::kMinus:
      return b_is_full ? Outcome::kEmpty : Outcome::kUnknown;
    case Operation::kAnd:
      return a_is_full ? Outcome::kB : b_is_full ? Outcome::kA : Outcome::kUnknown;
    case Operation::kXor:
      break;
  }
  return Outcome::kUnknown;
}

// Returns the reference file. The counts of the result (voxels and octree nodes) are the counts of
// this file, plus the changes at the places where the result differs (count_levels.h). So if most
// of the result is in this file, only few nodes must be counted. kEmpty means that there is no
// reference file, and all nodes of the result are counted.
constexpr Outcome reference_of(Operation operation, uint64_t nodes_of_a, uint64_t nodes_of_b) {
  if (operation == Operation::kAnd) return Outcome::kEmpty;
  if (operation == Operation::kMinus) return Outcome::kA;
  return nodes_of_a >= nodes_of_b ? Outcome::kA : Outcome::kB;
}

// Returns the result of two cubes with equal voxels.
constexpr Outcome outcome_of_equal(Operation operation) {
  return combine_bricks(operation, 1, 1) ? Outcome::kA : Outcome::kEmpty;
}

}  // namespace voxdag::query
