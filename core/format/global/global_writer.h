// Writes the global file: one SVDAG, levels contiguous, variable-size nodes, canonical bytes.
// docs/format.md, "The global file", is the byte layout; core/format/global/voxdag_reader.h reads
// it.
//
// Levels are stored in the order in which the merge finishes them, from the bricks up to the root.
// Within a level everything is addressed in 32-bit words from the level's start: a brick is two
// words (low half of the mask first), a node is its child mask followed by the word offsets of its
// children in the next level. Nothing in the file varies with time, place or machine.
//
// Checksums are made of the words as they come from the merge, never of what a file gives back, and
// the sealed file is read back: what a disk gives back wrong is Error{kCorrupt}.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"

namespace voxdag {

struct GlobalFileSummary {
  uint64_t bytes = 0;
  std::string sha256;  // 64 lower-case hex digits
};

// A level that was written.
struct GlobalLevel {
  uint64_t nodes = 0;
  uint64_t words = 0;
};

// What there is of a file that is not finished.
struct GlobalProgress {
  std::vector<GlobalLevel> levels;  // that ended, from the bricks upwards
  std::vector<uint64_t> checksums;  // of their blocks, the last one as far as it got
};

// Whether the file at `path` begins as a global file does.
bool is_global_file(FileSystem& files, const std::string& path);

class GlobalFileWriter {
 public:
  // Writes to "<path>.partial", from the first level on, until publish(). Throws Error.
  GlobalFileWriter(FileSystem& files, const std::string& path, const Grid& grid,
                   uint32_t hash_bits);
  // Without publish(): removes the partial file, unless it was synced to go on with.
  ~GlobalFileWriter();

  const std::string& path() const;
  // Goes on where an earlier writer was that wrote to the same path and synced. Throws
  // Error{kNotFound} or Error{kCorrupt} if the partial file is not there or too short; what it
  // holds is checked by seal(), but for the last block, which is read here.
  void go_on(const GlobalProgress& progress);
  // No level is open.
  GlobalProgress progress() const;
  // All levels that ended are on the disk from here on, and stay there for go_on(). May run beside
  // the writing of the next ones.
  void sync();

  // Levels must come as L-2, L-3, ..., 0; none at all for a scene without voxels.
  void begin_level(uint32_t level);
  // The words of the current level from its first to its last, by one thread at a time, for the
  // checksums: they are not written here.
  void checksum_words(std::span<const uint32_t> words);
  // Words [first, first + words.size()) of the current level; disjoint ranges in any order, also
  // from several threads at once.
  void write_words(uint64_t first, std::span<const uint32_t> words);
  // All `words` of the level were summed and written. A level over 2^32 words is Error{kLimit}
  // naming it.
  void end_level(uint64_t nodes, uint64_t words);

  // Adds checksums and header, syncs, and reads all back.
  GlobalFileSummary seal(uint64_t voxels, uint64_t svo_nodes, unsigned threads = 1,
                         const CancelToken& cancel = CancelToken());
  // Renames the sealed file to its final name and syncs the folder.
  void publish();
  GlobalFileSummary finish(uint64_t voxels, uint64_t svo_nodes) {
    const GlobalFileSummary summary = seal(voxels, svo_nodes);
    publish();
    return summary;
  }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
