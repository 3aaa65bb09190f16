// Writes one segment file: a header, then the artifacts that are appended one after the other.
//
// One thread uses a writer, except for sync_written().
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/format/artifact/artifact.h"
#include "core/io/file_system.h"

namespace voxdag {

// What a SegmentWriter charges to the budget: a buffer of 1 MiB, the frame that an ArtifactWriter
// builds, and zstd's tables.
inline constexpr uint64_t kSegmentWriterBytes = uint64_t{3} << 19;

// "segment-<id>.vdseg" in `folder`.
std::string segment_path(const std::string& folder, uint32_t id);

class FrameEncoder;

class SegmentWriter {
 public:
  // Creates the file, or empties it if it exists.
  SegmentWriter(FileSystem& files, const std::string& folder, uint32_t id, MemoryBudget& budget);
  ~SegmentWriter();
  uint32_t id() const { return id_; }
  // Bytes so far, buffered ones included.
  uint64_t size() const { return written_ + buffered_; }
  // Writes the buffer to the file without waiting for the disk, so that readers see all bytes.
  void flush();
  // Flushes and frees the buffer. Nothing may be appended after it.
  void complete();
  // Flushes, and returns once all bytes so far, and the name of the file, are on the disk.
  void sync();
  // The same for the bytes that were flushed before. It may run concurrently with all calls of
  // another thread but sync() and itself. Once it has failed it always fails, since the system
  // reports only once that it lost bytes.
  void sync_written();
  // Bytes that were flushed.
  uint64_t written() const { return written_; }
  // Frees the disk space that a flush left behind when it failed for lack of space.
  void release_unwritten();

 private:
  friend class ArtifactWriter;
  friend ArtifactRef copy_artifact(const ReadableFile&, const ArtifactRef&, const Cube&, uint32_t,
                                   SegmentWriter&);
  void append(std::span<const std::byte> bytes);
  // Ends the artifact whose first frame is at `first`.
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

}  // namespace voxdag
