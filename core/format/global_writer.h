// Writes the global file: one SVDAG, levels contiguous, variable-size nodes, canonical bytes.
// docs/format.md, "The global file", is the byte layout; core/format/voxdag_reader.h reads it.
//
// Levels are stored in the order in which the merge finishes them, from the bricks up to the root.
// Within a level everything is addressed in 32-bit words from the level's start: a brick is two
// words (low half of the mask first), a node is its child mask followed by the word offsets of its
// children in the next level. Nothing in the file varies with time, place or machine.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/base/cancel_token.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"

namespace voxdag {

struct GlobalFileSummary {
  uint64_t bytes = 0;
  std::string sha256;  // 64 lower-case hex digits
};

// Whether the file at `path` begins as a global file does.
bool is_global_file(FileSystem& files, const std::string& path);

class GlobalFileWriter {
 public:
  // Writes to "<path>.partial" until finish(). Throws Error.
  GlobalFileWriter(FileSystem& files, const std::string& path, const Grid& grid,
                   uint32_t hash_bits);
  // Without finish(): removes the partial file.
  ~GlobalFileWriter();

  // Levels must come as L-2, L-3, ..., 0; none at all for a scene without voxels.
  void begin_level(uint32_t level);
  // Words [first, first + words.size()) of the current level; disjoint ranges in any order, also
  // from several threads at once.
  void write_words(uint64_t first, std::span<const uint32_t> words);
  // All `words` of the level were written. A level over 2^32 words is Error{kLimit} naming it.
  void end_level(uint64_t nodes, uint64_t words);

  // Adds checksums and header, syncs, renames to the final name, syncs the folder.
  GlobalFileSummary finish(uint64_t voxels, uint64_t svo_nodes,
                           const CancelToken& cancel = CancelToken());

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
