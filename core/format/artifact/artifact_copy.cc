#include "core/format/artifact/artifact_copy.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/format/artifact/artifact_index.h"
#include "core/format/bytes.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

constexpr uint64_t kEntryMagic = 0x0a48434147414456;       // "VDAGACH\n"
constexpr uint64_t kSolidEntryMagic = 0x0a53434147414456;  // "VDAGACS\n"
constexpr size_t kFooterBytes = 48;
constexpr size_t kSolidFooterBytes = kFooterBytes + 16;
constexpr uint64_t kChunkBytes = uint64_t{256} << 10;

[[noreturn]] void corrupt_copy(const std::string& where, const std::string& what) {
  throw Error(ErrorCode::kCorrupt, where + ": " + what);
}

// Reads and checks the index of an artifact, which must have exactly one subvolume.
ArtifactIndex read_single_index(const ReadableFile& file, const ArtifactRef& ref) {
  if (ref.bytes > file.size() || ref.offset > file.size() - ref.bytes ||
      ref.index_offset < ref.offset || ref.index_offset - ref.offset > ref.bytes)
    corrupt_copy(file.path(), "the file has " + std::to_string(file.size()) +
                                  " bytes: expected an artifact of " + std::to_string(ref.bytes) +
                                  " bytes at byte " + std::to_string(ref.offset) +
                                  " with its index at byte " + std::to_string(ref.index_offset));
  check_index_bytes(ref, file.path());
  std::vector<std::byte> bytes(ref.offset + ref.bytes - ref.index_offset);
  file.read_at(ref.index_offset, bytes);
  ArtifactIndex index = decode_index(bytes, ref, file.path());
  if (index.roots.size() != 1)
    corrupt_copy(file.path(), "the artifact has " + std::to_string(index.roots.size()) +
                                  " subvolumes: expected 1");
  return index;
}

// Returns the checksum of a cache entry's footer: of its `fields`, followed by the entry's key. So
// an entry that is stored under the name of another key fails its checksum.
uint64_t footer_checksum(std::span<const std::byte> fields, const std::string& key) {
  std::vector<std::byte> bytes(fields.begin(), fields.end());
  const auto digits = std::as_bytes(std::span(key));
  bytes.insert(bytes.end(), digits.begin(), digits.end());
  return checksum64(bytes);
}

}  // namespace

ArtifactRef copy_artifact(const ReadableFile& from, const ArtifactRef& ref, const Cube& cube,
                          uint32_t grid_levels, SegmentWriter& to) {
  ArtifactIndex index = read_single_index(from, ref);
  if (index.shape.grid_levels - index.roots[0].cube.level != grid_levels - cube.level)
    corrupt_copy(from.path(),
                 "the artifact's cube has an edge of 2^" +
                     std::to_string(index.shape.grid_levels - index.roots[0].cube.level) +
                     " voxels: expected 2^" + std::to_string(grid_levels - cube.level));
  index.shape.grid_levels = grid_levels;
  index.roots[0].cube = cube;
  const uint64_t first = to.size();
  std::vector<std::byte> bytes;
  for (size_t i = 0; i < index.levels.size(); ++i) {
    index.levels[i].level = index.shape.brick_level() - static_cast<uint32_t>(i);
    for (const FrameInfo& frame : index.levels[i].frames) {
      bytes.resize(frame.bytes);
      from.read_at(frame.offset, bytes);
      if (checksum64(bytes) != frame.checksum)
        corrupt_copy(from.path(),
                     "the frame at byte " + std::to_string(frame.offset) + " fails its checksum");
      to.append(bytes);
    }
  }
  return to.append_index(first, encode_index(index, from.path()));
}

uint64_t write_cache_entry(FileSystem& files, const std::string& path, const std::string& partial,
                           const std::string& key, const ReadableFile& from, const ArtifactRef& ref,
                           const std::optional<SolidCounts>& solid) {
  const auto file = files.create(partial);
  const std::vector<std::byte> header = encode_segment_header(0);
  file->write_at(0, header);
  const uint64_t begin = header.size(), end = begin + ref.bytes;
  std::vector<std::byte> chunk;
  for (uint64_t at = begin; at < end; at += chunk.size()) {
    chunk.resize(std::min<uint64_t>(end - at, kChunkBytes));
    from.read_at(ref.offset + at - begin, chunk);
    file->write_at(at, chunk);
  }
  std::vector<std::byte> footer;
  ByteSink sink(footer);
  sink.put(solid ? kSolidEntryMagic : kEntryMagic);
  sink.put(begin);
  sink.put(ref.bytes);
  sink.put(uint64_t{ref.index_offset - ref.offset + begin});
  sink.put(ref.checksum);
  if (solid) {
    sink.put(solid->interior);
    sink.put(solid->disputed);
  }
  sink.put(footer_checksum(footer, key));
  file->write_at(end, footer);
  file->close();
  files.rename(partial, path);
  return end + footer.size();
}

CacheEntry read_cache_entry(FileSystem& files, const std::string& path, const std::string& key,
                            bool is_solid) {
  const size_t footer_bytes = is_solid ? kSolidFooterBytes : kFooterBytes;
  CacheEntry entry;
  entry.file = files.open_own(path);
  if (entry.file->size() < kSegmentHeaderBytes + footer_bytes)
    corrupt_copy(path, "it has " + std::to_string(entry.file->size()) +
                           " bytes: expected at least " +
                           std::to_string(kSegmentHeaderBytes + footer_bytes));
  std::byte header[kSegmentHeaderBytes];
  entry.file->read_at(0, header);
  check_segment_header(header, 0, path);
  std::vector<std::byte> footer(footer_bytes);
  entry.file->read_at(entry.file->size() - footer_bytes, footer);
  ByteSource source(footer);
  if (source.get<uint64_t>() != (is_solid ? kSolidEntryMagic : kEntryMagic))
    corrupt_copy(
        path,
        "its last " + std::to_string(footer_bytes) +
            " bytes do not begin with the signature of a footer: expected a complete cache entry");
  entry.ref.offset = source.get<uint64_t>();
  entry.ref.bytes = source.get<uint64_t>();
  entry.ref.index_offset = source.get<uint64_t>();
  entry.ref.checksum = source.get<uint64_t>();
  if (is_solid) {
    entry.solid.interior = source.get<uint64_t>();
    entry.solid.disputed = source.get<uint64_t>();
  }
  if (source.get<uint64_t>() != footer_checksum(std::span(footer).first(footer_bytes - 8), key))
    corrupt_copy(path, "its footer fails its checksum, or belongs to another key than " + key);
  const ArtifactIndex index = read_single_index(*entry.file, entry.ref);
  entry.root = index.roots[0];
  for (const ArtifactLevel& level : index.levels) entry.dag_nodes += level.rows;
  return entry;
}

}  // namespace voxdag
