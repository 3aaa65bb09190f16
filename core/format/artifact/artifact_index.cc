#include "core/format/artifact/artifact_index.h"

#include "core/base/error.h"
#include "core/dag/node_hash.h"
#include "core/format/checksum.h"
#include "core/format/cube_bytes.h"

namespace voxdag {
namespace {

constexpr uint64_t kFixedBytes = 40, kRootBytes = 48, kLevelBytes = 24, kFrameBytes = 32;

[[noreturn]] void corrupt(const std::string& where, const std::string& what) {
  throw Error(ErrorCode::kCorrupt, where + ": " + what);
}

void check_version(uint32_t version, const std::string& where) {
  if (version == kSegmentVersion) return;
  throw Error(ErrorCode::kUnsupportedVersion, where + ": segment format version " +
                                                  std::to_string(version) + ", expected " +
                                                  std::to_string(kSegmentVersion));
}

void put_root(ByteSink& sink, const ArtifactRoot& root) {
  put_cube(sink, root.cube);
  sink.put(root.index);
  sink.put(uint32_t{0});
  sink.put(root.hash);
  sink.put(root.voxels);
  sink.put(root.svo_nodes);
}

ArtifactRoot get_root(ByteSource& source, const std::string& where) {
  ArtifactRoot root;
  root.cube = get_cube(source);
  root.index = source.get<uint32_t>();
  if (const uint32_t reserved = source.get<uint32_t>(); reserved != 0)
    corrupt(where, "the reserved field of the root at row " + std::to_string(root.index) + " is " +
                       std::to_string(reserved) + ", expected 0");
  root.hash = source.get<uint64_t>();
  root.voxels = source.get<uint64_t>();
  root.svo_nodes = source.get<uint64_t>();
  return root;
}

void check_root(const ArtifactRoot& root, const ArtifactIndex& index, const std::string& where) {
  const uint32_t level = root.cube.level, brick_level = index.shape.brick_level();
  const std::string name =
      "the root at row " + std::to_string(root.index) + " of level " + std::to_string(level);
  const bool has_level = level <= brick_level && brick_level - level < index.levels.size();
  const uint64_t rows = has_level ? index.levels[brick_level - level].rows : 0;
  if (root.index >= rows)
    corrupt(where, name + " does not exist: expected a row of the " + std::to_string(rows) +
                       " rows that the artifact has on this level");
  for (const uint32_t p : root.cube.position)
    if (p >> level != 0)
      corrupt(where, name + " has the position " + std::to_string(p) + ", expected less than 2^" +
                         std::to_string(level));
  if (root.voxels == 0 || root.svo_nodes == 0)
    corrupt(where, name + " has " + std::to_string(root.voxels) + " voxels and " +
                       std::to_string(root.svo_nodes) +
                       " octree nodes, expected at least 1 of each");
  if (truncate_hash(root.hash, index.shape.hash_bits) != root.hash)
    corrupt(where, name + " has the hash " + std::to_string(root.hash) + ", expected at most " +
                       std::to_string(index.shape.hash_bits) + " bits");
}

// Reads the entries of one level's frames. `offset` is the segment offset of the level's first
// byte, and is advanced to the end of its last frame.
void get_frames(ByteSource& source, uint32_t count, bool bricks, ArtifactLevel& level,
                uint64_t& offset, const std::string& where) {
  const std::string here = where + ", level " + std::to_string(level.level);
  level.frames.reserve(count);
  uint64_t rows = 0, children = 0, hash = 0;
  for (uint32_t i = 0; i < count; ++i) {
    FrameInfo frame;
    frame.first_row = rows;
    frame.first_child = children;
    frame.offset = offset;
    frame.bytes = source.get<uint32_t>();
    frame.rows = source.get<uint32_t>();
    frame.children = source.get<uint32_t>();
    const uint32_t reserved = source.get<uint32_t>();
    frame.first_hash = source.get<uint64_t>();
    frame.checksum = source.get<uint64_t>();
    if (reserved != 0)
      corrupt(here, "the reserved field of frame " + std::to_string(i) + " is " +
                        std::to_string(reserved) + ", expected 0");
    if (frame.rows == 0 || frame.rows > kFrameRows || (i + 1 < count && frame.rows != kFrameRows))
      corrupt(here, "frame " + std::to_string(i) + " has " + std::to_string(frame.rows) +
                        " rows, expected " + (i + 1 < count ? "" : "1 to ") +
                        std::to_string(kFrameRows));
    if (bricks ? frame.children != 0
               : frame.children < frame.rows || frame.children > 8 * frame.rows)
      corrupt(here,
              "frame " + std::to_string(i) + " has " + std::to_string(frame.children) +
                  " children, expected " +
                  (bricks ? "0" : "1 to 8 for each of " + std::to_string(frame.rows) + " rows"));
    if (frame.first_hash < hash)
      corrupt(here, "the first hash of frame " + std::to_string(i) + " is " +
                        std::to_string(frame.first_hash) + ", expected at least " +
                        std::to_string(hash) + ", the first hash of frame " +
                        std::to_string(i - 1));
    hash = frame.first_hash;
    rows += frame.rows;
    children += frame.children;
    offset += frame.bytes;
    level.frames.push_back(frame);
  }
  if (rows != level.rows || children != level.children)
    corrupt(here, "the frames have " + std::to_string(rows) + " rows and " +
                      std::to_string(children) + " children, expected " +
                      std::to_string(level.rows) + " and " + std::to_string(level.children));
  if (rows == 0 || rows > uint64_t{1} << 32)
    corrupt(here, "the level has " + std::to_string(rows) + " rows, expected 1 to 2^32");
}

}  // namespace

std::vector<std::byte> encode_index(const ArtifactIndex& index, const std::string& where) {
  std::vector<std::byte> bytes;
  ByteSink sink(bytes);
  uint64_t frames = 0, frame_bytes = 0;
  for (const ArtifactLevel& level : index.levels) {
    frames += level.frames.size();
    for (const FrameInfo& frame : level.frames) frame_bytes += frame.bytes;
  }
  if (index.roots.size() > UINT32_MAX || frames > UINT32_MAX)
    throw Error(ErrorCode::kLimit,
                where + ": the artifact has " + std::to_string(index.roots.size()) + " roots and " +
                    std::to_string(frames) + " frames: expected at most 2^32-1 of each");
  sink.put(kIndexMagic);
  sink.put(kSegmentVersion);
  sink.put(index.shape.grid_levels);
  sink.put(index.shape.hash_bits);
  sink.put(static_cast<uint32_t>(index.roots.size()));
  sink.put(static_cast<uint32_t>(index.levels.size()));
  sink.put(static_cast<uint32_t>(frames));
  sink.put(frame_bytes);
  for (const ArtifactRoot& root : index.roots) put_root(sink, root);
  for (const ArtifactLevel& level : index.levels) {
    sink.put(level.level);
    sink.put(static_cast<uint32_t>(level.frames.size()));
    sink.put(level.rows);
    sink.put(level.children);
  }
  for (const ArtifactLevel& level : index.levels)
    for (const FrameInfo& frame : level.frames) {
      sink.put(frame.bytes);
      sink.put(frame.rows);
      sink.put(frame.children);
      sink.put(uint32_t{0});
      sink.put(frame.first_hash);
      sink.put(frame.checksum);
    }
  return bytes;
}

void check_index_bytes(const ArtifactRef& ref, const std::string& where) {
  const uint64_t bytes = ref.offset + ref.bytes - ref.index_offset;
  if (bytes > kMaxIndexBytes)
    corrupt(where, "the index has " + std::to_string(bytes) + " bytes, expected at most " +
                       std::to_string(kMaxIndexBytes));
}

ArtifactIndex decode_index(std::span<const std::byte> bytes, const ArtifactRef& ref,
                           const std::string& where) {
  if (checksum64(bytes) != ref.checksum) corrupt(where, "the index fails its checksum");
  ByteSource source(bytes);
  if (source.get<uint64_t>() != kIndexMagic)
    corrupt(where, "no index begins at byte " + std::to_string(ref.index_offset) +
                       ": expected the signature of an index");
  check_version(source.get<uint32_t>(), where);
  ArtifactIndex index;
  index.shape.grid_levels = source.get<uint32_t>();
  index.shape.hash_bits = source.get<uint32_t>();
  const uint64_t roots = source.get<uint32_t>();
  const uint64_t levels = source.get<uint32_t>();
  const uint64_t frames = source.get<uint32_t>();
  const uint64_t frame_bytes = source.get<uint64_t>();
  if (index.shape.grid_levels < kMinGridLevels || index.shape.grid_levels > kMaxGridLevels)
    corrupt(where, "the index names a grid of 2^" + std::to_string(index.shape.grid_levels) +
                       " voxels per edge, expected 2^" + std::to_string(kMinGridLevels) + " to 2^" +
                       std::to_string(kMaxGridLevels));
  if (index.shape.hash_bits < 4 || index.shape.hash_bits > 64)
    corrupt(where, "the index names " + std::to_string(index.shape.hash_bits) +
                       " hash bits, expected 4 to 64");
  if (levels > index.shape.brick_level() + 1)
    corrupt(where, "the index has " + std::to_string(levels) + " levels, expected at most " +
                       std::to_string(index.shape.brick_level() + 1));
  // After this check, the size of `bytes` limits all allocations below.
  const uint64_t expected =
      kFixedBytes + roots * kRootBytes + levels * kLevelBytes + frames * kFrameBytes;
  if (bytes.size() != expected)
    corrupt(where, "the index has " + std::to_string(bytes.size()) + " bytes, expected " +
                       std::to_string(expected) + " for " + std::to_string(roots) + " roots, " +
                       std::to_string(levels) + " levels and " + std::to_string(frames) +
                       " frames");
  if (frame_bytes != ref.index_offset - ref.offset)
    corrupt(where, "the frames have " + std::to_string(ref.index_offset - ref.offset) +
                       " bytes, expected " + std::to_string(frame_bytes));

  for (uint64_t i = 0; i < roots; ++i) index.roots.push_back(get_root(source, where));
  std::vector<uint32_t> frame_counts;
  uint64_t frames_of_levels = 0;
  for (uint64_t i = 0; i < levels; ++i) {
    ArtifactLevel level;
    level.level = source.get<uint32_t>();
    frame_counts.push_back(source.get<uint32_t>());
    level.rows = source.get<uint64_t>();
    level.children = source.get<uint64_t>();
    if (level.level != index.shape.brick_level() - i)
      corrupt(where, "entry " + std::to_string(i) + " of the levels in the index is level " +
                         std::to_string(level.level) + ", expected level " +
                         std::to_string(index.shape.brick_level() - i));
    frames_of_levels += frame_counts.back();
    index.levels.push_back(std::move(level));
  }
  if (frames_of_levels != frames)
    corrupt(where, "the levels have " + std::to_string(frames_of_levels) + " frames, expected " +
                       std::to_string(frames));
  uint64_t offset = ref.offset;
  for (uint64_t i = 0; i < levels; ++i)
    get_frames(source, frame_counts[i], i == 0, index.levels[i], offset, where);
  if (offset != ref.index_offset)
    corrupt(where, "the frames end at byte " + std::to_string(offset) +
                       ", expected the index there, which begins at byte " +
                       std::to_string(ref.index_offset));
  for (const ArtifactRoot& root : index.roots) check_root(root, index, where);
  return index;
}

std::vector<std::byte> encode_segment_header(uint32_t id) {
  std::vector<std::byte> bytes;
  ByteSink sink(bytes);
  sink.put(kSegmentMagic);
  sink.put(kSegmentVersion);
  sink.put(id);
  sink.put(uint64_t{0});
  sink.put(checksum64(bytes));
  return bytes;
}

void check_segment_header(std::span<const std::byte> bytes, uint32_t id, const std::string& where) {
  ByteSource source(bytes);
  if (source.get<uint64_t>() != kSegmentMagic)
    corrupt(where, "not a voxdag segment file: expected the signature in its first 8 bytes");
  check_version(source.get<uint32_t>(), where);
  const uint32_t found_id = source.get<uint32_t>();
  source.get<uint64_t>();
  if (source.get<uint64_t>() != checksum64(bytes.first(kSegmentHeaderBytes - sizeof(uint64_t))))
    corrupt(where, "the segment header fails its checksum");
  if (found_id != id)
    corrupt(where,
            "it contains segment " + std::to_string(found_id) + ", expected " + std::to_string(id));
}

}  // namespace voxdag
