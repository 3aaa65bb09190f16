// Writes one segment file: a header, then one artifact after another.
//
// Only one thread may use a writer, except that another thread may call sync_written().
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

// Bytes of memory that a SegmentWriter charges: a buffer of 1 MiB, the frame that an ArtifactWriter
// builds, and zstd's tables.
inline constexpr uint64_t kSegmentWriterBytes = uint64_t{3} << 19;

// Returns the path of a segment: "segment-<id>.vdseg" in `folder`.
std::string segment_path(const std::string& folder, uint32_t id);

class FrameEncoder;

class SegmentWriter {
 public:
  // Creates the file, or empties it if it exists.
  SegmentWriter(FileSystem& files, const std::string& folder, uint32_t id, MemoryBudget& budget);
  ~SegmentWriter();
  uint32_t id() const { return id_; }
  // Returns the number of bytes appended so far, including buffered bytes.
  uint64_t size() const { return written_ + buffered_; }
  // Writes the buffer to the file, so that readers see all bytes. Does not wait for the disk.
  void flush();
  // Flushes and frees the buffer. Nothing may be appended afterwards.
  void complete();
  // Flushes the buffer, and waits until all bytes and the file's directory entry are on the disk.
  void sync();
  // Syncs the bytes that were flushed before the call. Another thread may concurrently call any
  // function except sync() and sync_written(). After one failure, every later call fails, because
  // the system reports lost bytes only once.
  void sync_written();
  // Returns the number of bytes flushed to the file so far.
  uint64_t written() const { return written_; }
  // Frees the disk space of a partial write. Call it after flush() failed because the disk was
  // full. The bytes remain in the buffer, so a later flush() can write them again.
  void release_unwritten();

 private:
  friend class ArtifactWriter;
  friend ArtifactRef copy_artifact(const ReadableFile&, const ArtifactRef&, const Cube&, uint32_t,
                                   SegmentWriter&);
  void append(std::span<const std::byte> bytes);
  // Appends the index of the artifact whose first frame is at offset `first`, and returns the
  // artifact's position.
  ArtifactRef append_index(uint64_t first, std::span<const std::byte> index);

  FileSystem& files_;
  const std::string folder_;
  const uint32_t id_;
  std::unique_ptr<WritableFile> file_;
  MemoryCharge frame_charge_;
  PageBuffer<std::byte> buffer_;
  std::unique_ptr<FrameEncoder> encoder_;
  uint64_t written_ = 0;  // bytes written to the file
  size_t buffered_ = 0;
  bool name_synced_ = false;
  bool sync_failed_ = false;
};

}  // namespace voxdag
