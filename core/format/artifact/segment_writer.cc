#include "core/format/artifact/segment_writer.h"

#include <algorithm>
#include <cstring>

#include "core/base/error.h"
#include "core/format/artifact/artifact_index.h"
#include "core/format/artifact/frame_codec.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

constexpr uint64_t kBufferBytes = uint64_t{1} << 20;

}  // namespace

std::string segment_path(const std::string& folder, uint32_t id) {
  return folder + "/segment-" + std::to_string(id) + ".vdseg";
}

SegmentWriter::SegmentWriter(FileSystem& files, const std::string& folder, uint32_t id,
                             MemoryBudget& budget)
    : files_(files),
      folder_(folder),
      id_(id),
      file_(files.create(segment_path(folder, id))),
      frame_charge_(budget, kSegmentWriterBytes - kBufferBytes, "an artifact's frame"),
      buffer_(budget, kBufferBytes, "a segment's write buffer"),
      encoder_(std::make_unique<FrameEncoder>()) {
  append(encode_segment_header(id));
}

SegmentWriter::~SegmentWriter() = default;

void SegmentWriter::append(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    if (buffered_ == buffer_.size()) flush();
    const size_t n = std::min(bytes.size(), buffer_.size() - buffered_);
    std::memcpy(buffer_.data() + buffered_, bytes.data(), n);
    buffered_ += n;
    bytes = bytes.subspan(n);
  }
}

ArtifactRef SegmentWriter::append_index(uint64_t first, std::span<const std::byte> index) {
  ArtifactRef ref;
  ref.segment = id_;
  ref.offset = first;
  ref.index_offset = size();
  ref.bytes = ref.index_offset + index.size() - first;
  ref.checksum = checksum64(index);
  // Decodes the index once, so that no reference points to an index that readers would refuse.
  decode_index(index, ref, "artifact for segment " + std::to_string(id_));
  append(index);
  return ref;
}

void SegmentWriter::flush() {
  if (buffered_ == 0) return;
  file_->write_at(written_, std::span<const std::byte>(buffer_.data(), buffered_));
  written_ += buffered_;
  buffered_ = 0;
}

void SegmentWriter::complete() {
  flush();
  buffer_ = {};
  frame_charge_ = {};
  encoder_.reset();
}

void SegmentWriter::sync() {
  flush();
  sync_written();
}

void SegmentWriter::sync_written() {
  if (sync_failed_)
    throw Error(ErrorCode::kIo,
                "sync " + file_->path() +
                    ": an earlier sync of this file failed, so its contents are uncertain; "
                    "start the build again");
  sync_failed_ = true;
  file_->sync();
  sync_failed_ = false;
  if (!name_synced_) files_.sync_directory(folder_);
  name_synced_ = true;
}

void SegmentWriter::release_unwritten() { file_->release(written_, buffered_); }

}  // namespace voxdag
