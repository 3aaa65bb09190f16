#include "core/format/artifact/artifact_reader.h"

#include <string>

#include "core/base/error.h"
#include "core/format/artifact/artifact_index.h"
#include "core/format/artifact/frame_codec.h"
#include "core/format/artifact/row_order.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

// Reads the bytes of the index. Throws Error{kCorrupt} if the artifact is not within the file.
std::vector<std::byte> read_index(const ReadableFile& file, const ArtifactRef& ref,
                                  const std::string& where) {
  const uint64_t size = file.size();
  const bool inside = ref.offset >= kSegmentHeaderBytes && ref.index_offset >= ref.offset &&
                      ref.offset <= size && ref.bytes <= size - ref.offset &&
                      ref.index_offset - ref.offset <= ref.bytes;
  if (!inside)
    throw Error(ErrorCode::kCorrupt,
                where + ": it has " + std::to_string(ref.bytes) +
                    " bytes, and its index begins at byte " + std::to_string(ref.index_offset) +
                    ": expected an artifact between byte " + std::to_string(kSegmentHeaderBytes) +
                    " and the end of the file (byte " + std::to_string(size) +
                    "), and an index inside the artifact");
  check_index_bytes(ref, where);
  std::vector<std::byte> bytes(ref.offset + ref.bytes - ref.index_offset);
  file.read_at(ref.index_offset, bytes);
  return bytes;
}

}  // namespace

ArtifactReader::ArtifactReader(std::shared_ptr<ReadableFile> segment, const ArtifactRef& ref)
    : file_(std::move(segment)),
      place_(file_->path() + ", artifact at byte " + std::to_string(ref.offset)) {
  if (file_->size() < kSegmentHeaderBytes)
    throw Error(ErrorCode::kCorrupt, file_->path() + " has " + std::to_string(file_->size()) +
                                         " bytes: expected a segment header of " +
                                         std::to_string(kSegmentHeaderBytes) + " bytes");
  std::byte header[kSegmentHeaderBytes];
  file_->read_at(0, header);
  check_segment_header(header, ref.segment, file_->path());
  ArtifactIndex index = decode_index(read_index(*file_, ref, place_), ref, place_);
  shape_ = index.shape;
  roots_ = std::move(index.roots);
  levels_ = std::move(index.levels);
}

const ArtifactLevel* ArtifactReader::level(uint32_t level) const {
  const uint32_t brick_level = shape_.brick_level();
  if (level > brick_level || brick_level - level >= levels_.size()) return nullptr;
  return &levels_[brick_level - level];
}

void ArtifactReader::damaged(uint32_t level, size_t frame, const std::string& what) const {
  throw Error(ErrorCode::kCorrupt, place_ + ", level " + std::to_string(level) + ", frame " +
                                       std::to_string(frame) + ": " + what);
}

void ArtifactReader::read_frame(uint32_t level, size_t index, Frame& out) const {
  const size_t place = shape_.brick_level() - level;
  const std::vector<FrameInfo>& frames = levels_[place].frames;
  const FrameInfo& info = frames[index];
  out.stored.resize(info.bytes);
  file_->read_at(info.offset, out.stored);
  if (checksum64(out.stored) != info.checksum) damaged(level, index, "it fails its checksum");

  const bool bricks = place == 0;
  const char* wrong = bricks ? decode_brick_frame(out.stored, info.rows, shape_.hash_bits, out)
                             : decode_node_frame(out.stored, info.rows, info.children, out);
  LastRow last;
  if (!wrong)
    wrong = bricks ? check_brick_order(out.hashes, out.brick_masks, last)
                   : check_node_order({level, out.hashes, out.masks, out.children},
                                      levels_[place - 1].rows, shape_.hash_bits, last);
  if (wrong) damaged(level, index, wrong);
  if (out.hashes.front() != info.first_hash)
    damaged(level, index, "its first hash differs from the hash in the index");
  if (index + 1 < frames.size() && last.hash > frames[index + 1].first_hash)
    damaged(level, index, "its last hash is greater than the first hash of the next frame");
}

}  // namespace voxdag
