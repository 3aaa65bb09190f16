// Artifacts: sub-DAGs on disk between the build and the merge, many to a segment file.
// docs/format.md, "Segments and artifacts", is the byte layout.
//
//   segment:   [header] [artifact] [artifact] ...
//   artifact:  [frames of the brick level] [frames of level L-3] ... [frames of the top level]
//   [index]
//
// A frame holds kFrameRows consecutive rows of one level (the last frame of a level: the rest), as
// columns (bricks: masks; nodes: hashes, masks, children), zstd-compressed where that pays, with a
// checksum of its bytes as stored. The index lists roots, levels and frames, with a checksum of its
// own; an ArtifactRef points at it, so that a reader never scans.
//
// An artifact of one subvolume has one root; a merge round writes artifacts that hold many. Rows
// are checked on the way in and on the way out: total order, masks not 0, children within the next
// level; out also checksums and counts. Error{kCorrupt} names segment, level and frame or row.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/dag/level_array.h"
#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "core/io/file_system.h"

namespace voxdag {

inline constexpr uint32_t kFrameRows = 4096;
// What a SegmentWriter charges: a buffer of 1 MiB, a frame in the making and zstd's tables.
inline constexpr uint64_t kSegmentWriterBytes = uint64_t{3} << 19;

// Where an artifact lies. `checksum` is that of its index, which carries those of all frames.
struct ArtifactRef {
  uint32_t segment = 0;       // id of the segment file
  uint64_t offset = 0;        // first byte of the artifact
  uint64_t bytes = 0;         // frames and index together
  uint64_t index_offset = 0;  // first byte of the index
  uint64_t checksum = 0;
  bool operator==(const ArtifactRef&) const = default;
};

// The root of one subvolume within an artifact: node `index` of the array of level cube.level.
struct ArtifactRoot {
  Cube cube;
  uint32_t index = 0;
  uint64_t hash = 0;  // cut
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;
};

// "segment-<id>.vdseg" in `folder`.
std::string segment_path(const std::string& folder, uint32_t id);

class FrameEncoder;

// One segment file being written, by one thread. Charges kSegmentWriterBytes to the budget: its
// buffer, and what an ArtifactWriter needs to make a frame.
class SegmentWriter {
 public:
  // A new file; one of that name that was there is emptied.
  SegmentWriter(FileSystem& files, const std::string& folder, uint32_t id, MemoryBudget& budget);
  ~SegmentWriter();
  uint32_t id() const { return id_; }
  // Bytes so far, buffered ones included.
  uint64_t size() const { return written_ + buffered_; }
  // Writes the buffer out without waiting for the disk; readers see all bytes from here on.
  void flush();
  // Nothing more is appended: writes the buffer out and gives back its memory.
  void complete();
  // Writes the buffer out and returns once all bytes so far, and the file's name, are on the disk.
  void sync();
  // The same for what is out of the buffer already. May run beside another thread's calls other
  // than sync() and this. Once it has failed it always does: the system tells only once that it
  // lost what it should have written.
  void sync_written();
  // Bytes that are out of the buffer.
  uint64_t written() const { return written_; }
  // Gives back the space of what a flush left behind that failed for want of it.
  void release_unwritten();

 private:
  friend class ArtifactWriter;
  friend ArtifactRef copy_artifact(const ReadableFile&, const ArtifactRef&, const Cube&, uint32_t,
                                   SegmentWriter&);
  void append(std::span<const std::byte> bytes);
  // Ends the artifact whose first frame lies at `first`.
  ArtifactRef append_index(uint64_t first, std::span<const std::byte> index);

  FileSystem& files_;
  const std::string folder_;
  const uint32_t id_;
  std::unique_ptr<WritableFile> file_;
  MemoryCharge frame_charge_;
  PageBuffer<std::byte> buffer_;
  std::unique_ptr<FrameEncoder> encoder_;
  uint64_t written_ = 0;  // bytes in the file
  size_t buffered_ = 0;
  bool name_synced_ = false;
  bool sync_failed_ = false;
};

// Writes one artifact, level by level from the bricks upwards, any number of rows at a time.
class ArtifactWriter : public SubDagSink {
 public:
  // At most one ArtifactWriter lives per segment at a time. One that is destroyed without finish()
  // leaves garbage bytes that nothing names.
  ArtifactWriter(SegmentWriter& segment, uint32_t grid_levels, uint32_t hash_bits);
  ~ArtifactWriter() override;

  void begin_level(uint32_t level);
  void append_bricks(std::span<const uint64_t> masks);
  void append_nodes(const NodeLevelView& rows);
  void end_level();

  // SubDagSink: a whole level at once.
  void bricks(const BrickLevelView& level) override;
  void nodes(const NodeLevelView& level) override;

  // Writes the index. The artifact can be read once the segment was flushed.
  ArtifactRef finish(std::span<const ArtifactRoot> roots);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// One frame's place in its level.
struct FrameInfo {
  uint64_t first_row = 0;
  uint64_t first_child = 0;  // children of the level's rows before this frame
  uint64_t first_hash = 0;   // cut hash of its first row
  uint64_t offset = 0;       // in the segment
  uint32_t bytes = 0;        // as stored
  uint32_t rows = 0;
  uint32_t children = 0;
  uint64_t checksum = 0;
};

struct ArtifactLevel {
  uint32_t level = 0;
  uint64_t rows = 0;
  uint64_t children = 0;
  std::vector<FrameInfo> frames;
};

// A decoded frame, and scratch memory for the next one: its stored bytes, and one column of it.
struct Frame {
  uint32_t rows = 0;
  std::vector<uint64_t> brick_masks;  // brick level only
  std::vector<uint64_t> hashes;       // cut; for bricks too
  std::vector<uint8_t> masks;         // node levels only
  std::vector<uint32_t> children;     // node levels only, popcount(masks[i]) for row i
  std::vector<std::byte> scratch;
  std::vector<std::byte> planes;
};

// Reads one artifact. Immutable after construction: read_frame() may be called by several threads,
// each with its own Frame. Memory: the index (56 bytes per frame), not charged.
class ArtifactReader {
 public:
  // `segment` must be the file that ref.segment names. Throws Error{kCorrupt} or
  // Error{kUnsupportedVersion}.
  ArtifactReader(std::shared_ptr<ReadableFile> segment, const ArtifactRef& ref);

  uint32_t grid_levels() const { return grid_levels_; }
  uint32_t hash_bits() const { return hash_bits_; }
  std::span<const ArtifactRoot> roots() const { return roots_; }
  // From the bricks upwards: level L-2 first.
  std::span<const ArtifactLevel> levels() const { return levels_; }
  // nullptr if the artifact does not reach up to `level`.
  const ArtifactLevel* level(uint32_t level) const;
  // Decodes frame `index` of `level`, which must be there.
  void read_frame(uint32_t level, size_t index, Frame& out) const;

 private:
  [[noreturn]] void damaged(uint32_t level, size_t frame, const std::string& what) const;

  std::shared_ptr<ReadableFile> file_;
  uint32_t grid_levels_ = 0;
  uint32_t hash_bits_ = 64;
  std::vector<ArtifactRoot> roots_;
  std::vector<ArtifactLevel> levels_;
};

}  // namespace voxdag
