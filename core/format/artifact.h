// Artifacts: sub-DAGs on disk between the build and the merge, many to a segment file.
// docs/format.md, "Segments and artifacts", is the byte layout.
//
//   segment:   [header] [artifact] [artifact] ...
//   artifact:  [frames of the brick level] [frames of level L-3] ... [frames of the top level]
//   [index]
//
// A frame holds up to kFrameRows consecutive rows of one level, as columns (bricks: masks; nodes:
// hashes, masks, children), zstd-compressed, with a checksum of its compressed bytes. The index
// lists roots, levels and frames, with a checksum of its own; an ArtifactRef points at it, so that
// a reader never scans.
//
// An artifact of one subvolume has one root; a merge round writes artifacts that hold many. Rows
// are checked on the way in (order) and on the way out (checksum, counts, ranges): Error{kCorrupt}
// names segment, level and frame.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/dag/level_array.h"
#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "core/io/file_system.h"

namespace voxdag {

inline constexpr uint32_t kFrameRows = 4096;

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

// One segment file being written, by one thread. Bytes are buffered (charged to the budget).
class SegmentWriter {
 public:
  SegmentWriter(FileSystem& files, const std::string& folder, uint32_t id, MemoryBudget& budget);
  ~SegmentWriter();
  uint32_t id() const;
  // Bytes so far, buffered ones included.
  uint64_t size() const;
  // Writes the buffer out and returns once all bytes so far are on the disk.
  void sync();
  // Writes the buffer out without waiting for the disk; readers see all bytes from here on.
  void flush();

 private:
  friend class ArtifactWriter;
  struct State;
  std::unique_ptr<State> state_;
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
  uint32_t bytes = 0;        // compressed
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

// A decoded frame, and the scratch memory to decode the next one into.
struct Frame {
  uint32_t rows = 0;
  std::vector<uint64_t> brick_masks;  // brick level only
  std::vector<uint64_t> hashes;       // cut; for bricks too
  std::vector<uint8_t> masks;         // node levels only
  std::vector<uint32_t> children;     // node levels only, popcount(masks[i]) for row i
  std::vector<std::byte> scratch;
};

// Reads one artifact. Immutable after construction: read_frame() may be called by several threads,
// each with its own Frame. Memory: the index (about 50 bytes a frame), not charged.
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
  // Decodes frame `index` of `level`, checksum, counts and child range verified.
  void read_frame(uint32_t level, size_t index, Frame& out) const;

 private:
  std::shared_ptr<ReadableFile> file_;
  uint32_t grid_levels_ = 0;
  uint32_t hash_bits_ = 64;
  std::vector<ArtifactRoot> roots_;
  std::vector<ArtifactLevel> levels_;
};

}  // namespace voxdag
