// The data that the functions of verify_nodes.cc share: their arguments, and the values of a level.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/global/node_index.h"
#include "core/format/global/page_limit.h"
#include "core/format/global/voxdag_reader.h"
#include "core/format/verify/span_file.h"
#include "core/format/verify/subtree_table.h"
#include "core/format/verify/verify_scratch.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// The arguments of verify_global_file().
struct VerifyTask {
  const voxdag_reader::File& file;
  unsigned threads = 1;
  MemoryBudget& budget;
  Progress& progress;
  const CancelToken& cancel;
  bool is_quick = false;
  PageLimit& pages;
  VerifyScratch* scratch = nullptr;  // null if all tables must be in memory

  // Returns the bytes that tables may use now.
  uint64_t free_memory() const {
    return scratch ? std::min(budget.available(), scratch->memory_bytes) : UINT64_MAX;
  }
  // Returns the number of threads whose buffers fit in an eighth of the free memory. For each word
  // of a span, a thread needs memory for its pointer, the values of a child, and the values of a
  // third of a node: 36 bytes.
  unsigned threads_for_scratch() const {
    const uint64_t fitting = budget.available() / 8 / (36 * scratch->span_words);
    return static_cast<unsigned>(std::clamp<uint64_t>(fitting, 1, threads));
  }
};

// A level whose nodes are checked, with the values of its nodes. They are in memory, with an index
// of the level, or *stored*: in a scratch file, in the order of the nodes.
struct CheckedLevel {
  uint32_t level = 0;
  uint32_t cube_levels = 0;  // the cubes of the level's nodes have 2^cube_levels voxels per edge
  // In memory:
  NodeIndex index;
  SubtreeTable table;
  // Stored. `values` is null if the level is in memory.
  NodeSpans spans;
  std::unique_ptr<SpanFile> values;

  bool is_stored() const { return values != nullptr; }
  uint64_t span_count() const { return is_stored() ? spans.size() : index.span_count(); }
  uint64_t last_before(uint64_t span) const {
    return is_stored() ? spans.last_before(span) : index.last_before(span);
  }
  template <class Visit>
  void visit_span(uint64_t span, const Visit& visit) const {
    if (is_stored())
      spans.visit_span(span, visit);
    else
      index.visit_span(span, visit);
  }
};

// A part of a stored level in memory: the spans `first` to `end` - 1. Offsets and indexes of nodes
// count from the first ones in the part.
struct LevelWindow {
  NodeIndex index;
  SubtreeTable table;

  LevelWindow(const VerifyTask& task, unsigned threads, const CheckedLevel& level, uint64_t first,
              uint64_t end);
  // Returns the memory of a window of `words` words and `nodes` nodes.
  static uint64_t bytes(bool are_bricks, uint32_t cube_levels, uint64_t words, uint64_t nodes) {
    return (are_bricks ? 0 : (words / 64 + 1) * sizeof(NodeWords)) +
           nodes * SubtreeTable::node_words(cube_levels) * sizeof(uint32_t);
  }
};

// Returns the index of the first node without a parent; NodeIndex::kNone if all have parents.
uint64_t first_orphan(const VerifyTask& task, const SubtreeTable& table);

}  // namespace voxdag
