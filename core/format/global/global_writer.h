// Writes the global file: one SVDAG with contiguous levels and nodes of variable size. The scene
// and the geometry options determine its bytes. docs/format.md, "The global file", documents the
// byte layout. voxdag_reader.h reads the file.
//
// Levels are stored in the order in which the merge finishes them, from the bricks up to the root.
// Within a level everything is addressed in 32-bit words from the level's start. A brick is two
// words, the low half of the mask first. A node is its child mask, then the word offsets of its
// children in the next finer level. An offset is one word, or two (low half first) if the next
// finer level is wide (has more than narrow_words() words). Nothing in the file depends on the
// time, the path or the machine.
//
// Checksums are computed from the words and bytes that the caller passes in, not from the file.
// (Exception: resume() reads the last, incomplete checksum block from the file, and compares it
// with its saved checksum.) seal() reads the file back, compares it with these checksums, and
// throws Error{kCorrupt} if the disk returns wrong bytes.
//
// Only one thread may use a writer, except that other threads may call write_words() and sync().
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/format/global/global_layout.h"
#include "core/geometry/grid.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

struct GlobalFileSummary {
  uint64_t bytes = 0;
  std::string sha256;  // 64 lower-case hex digits
};

// Totals of the octree that cannot be computed from the sizes of the levels.
struct VoxelCounts {
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;
};

// The size of a level that was written.
struct GlobalLevel {
  uint64_t nodes = 0;
  uint64_t words = 0;
};

// Describes an attribute section, with a value for every set cell of the levels 0 to `cell_levels`.
struct GlobalAttribute {
  uint32_t kind = 0;
  uint32_t cell_levels = 0;
  uint32_t block_bytes = 0;   // bytes for the values of 32 cells
  uint64_t cells = 0;         // cells of all levels
  uint64_t finest_cells = 0;  // cells of the finest level
};

// The contents of an unfinished file, from which a later run can resume.
struct GlobalFileProgress {
  std::vector<GlobalLevel> levels;  // complete levels, from the bricks upwards
  std::vector<uint64_t> checksums;  // one for each checksum block; the last block may be partial
};

// The header page and the checksum table of a file without attribute sections, from which a reader
// can read the levels of a partial file (GlobalFileWriter::frame()).
struct GlobalFileFrame {
  std::vector<std::byte> header;
  std::vector<std::byte> table;
};

// True if the file begins with the magic of a global file.
bool is_global_file(const ReadableFile& file);
// True if it is possible that `file` is a complete or incomplete global file: it begins with the
// magic of a global file, or its first page, which is written last, still has only zeros.
bool is_partial_global_file(const ReadableFile& file);

class GlobalFileWriter {
 public:
  // Writes to "<path>.partial", which is created with the first level; publish() or rename()
  // renames it. Levels of more than `narrow_words` words are wide: pointers into them have 64 bits.
  // Throws Error.
  GlobalFileWriter(FileSystem& files, const std::string& path, const Grid& grid, uint32_t hash_bits,
                   uint64_t narrow_words = global_layout::kNarrowLevelWords);
  // Removes the partial file, unless it was renamed, or sync() or resume() made it resumable.
  ~GlobalFileWriter();

  const std::string& path() const;
  uint64_t narrow_words() const;
  bool is_wide(uint64_t level_words) const { return level_words > narrow_words(); }
  // Continues after an earlier writer that wrote to the same path and called sync(). Throws
  // Error{kNotFound} if the partial file is missing. Throws Error{kCorrupt} if it is too short, or
  // if its last checksum block, which this function reads, is damaged. seal() checks the other
  // blocks.
  void resume(const GlobalFileProgress& progress);
  // Returns the state that resume() needs. Call it while no level is open and before the first
  // section.
  GlobalFileProgress progress() const;
  // Makes all complete levels durable, and retains the partial file for resume(). Another thread
  // may write the next levels concurrently.
  void sync();

  // Sets the order in which the caller will write the nodes of each level. The file's header names
  // this order. The default is the order by hash.
  void set_node_order(NodeOrder order);

  // Begins a level. Levels must come in the order L-2, L-3, ..., 0. A scene without voxels has no
  // levels.
  void begin_level(uint32_t level);
  // Adds the next words of the current level to the checksums without writing them. Call it for all
  // words of the level, in order. Two calls must not run concurrently.
  void checksum_words(std::span<const uint32_t> words);
  // Writes words [first, first + words.size()) of the current level. Disjoint ranges may be written
  // in any order and concurrently from several threads.
  void write_words(uint64_t first, std::span<const uint32_t> words);
  // Ends the level. All its words must have been written and added to the checksums. Throws
  // Error{kLimit}, whose message names the level, if the level has more than 2^40 words.
  void end_level(const GlobalLevel& level);

  // If the caller knows the sizes of all levels, the next three functions replace begin_level(),
  // checksum_words(), write_words() and end_level(). place_levels() determines the levels' offsets;
  // `levels` begins with the bricks. Then write_placed() writes words of any level, each word once
  // and in any order, and finish_placed() completes the levels. Such a file cannot be resumed.
  void place_levels(std::span<const GlobalLevel> levels);
  void write_placed(uint32_t level, uint64_t first, std::span<const uint32_t> words);
  void finish_placed();

  // If the scene has voxels, attribute sections may follow the levels, in increasing order of their
  // kinds. The bytes of a section are appended in order. A writer that resumes a file must write
  // its sections again.
  void begin_section();
  void append(std::span<const std::byte> bytes);
  uint64_t section_bytes() const;  // bytes of the open section so far
  void end_section(const GlobalAttribute& attribute);

  // Returns the header page and the checksum table that the file would have without attribute
  // sections. Call it after the last level and before the first section. Afterwards, readers of the
  // partial file see all levels.
  GlobalFileFrame frame(const VoxelCounts& counts) const;

  // Writes checksums and header, syncs the file, and reads it back to verify it. Returns the size
  // and the SHA-256 of the file.
  GlobalFileSummary seal(const VoxelCounts& counts, unsigned threads = 1,
                         const CancelToken& cancel = CancelToken());
  // Completes a temporary file, and renames it to its final name. Writes checksums and header, but
  // neither syncs the file nor reads it back. Returns the size of the file.
  uint64_t finish_temporary(const VoxelCounts& counts);
  // Renames the sealed file to its final name and syncs the folder.
  void publish();
  // Renames the sealed file to its final name. The caller syncs the folder.
  void rename();
  // Seals and publishes the file.
  GlobalFileSummary finish(const VoxelCounts& counts) {
    const GlobalFileSummary summary = seal(counts);
    publish();
    return summary;
  }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace voxdag
