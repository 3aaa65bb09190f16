// The temporary files of verify_global_file(), for the tables that do not fit in memory. The names
// of the files are removed when they are created, so the system frees their disk space when the
// process ends, even if it is killed. (On a network file system, the names can remain as long as
// the files are open.)
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/format/global/node_index.h"
#include "core/io/file_system.h"
#include "core/io/outputs/temporary_work.h"

namespace voxdag {

class VerifyScratch {
 public:
  // `prefix` is the beginning of the paths of temporary folders, in which the files are created.
  VerifyScratch(FileSystem& files, std::string prefix)
      : files_(files), prefix_(std::move(prefix)) {}

  FileSystem& files() { return files_; }
  const std::string& prefix() const { return prefix_; }
  // Throws Error{kNoSpace} unless the disk has `bytes` free bytes. The message says that the bytes
  // are for `what`.
  void require_space(uint64_t bytes, const std::string& what) const;
  // Bytes that were written to files, including removed files.
  uint64_t bytes_written() const { return bytes_written_; }
  void count_written(uint64_t bytes) { bytes_written_ += bytes; }

  // Smaller values let tests use files with small levels: the memory for tables if it is less than
  // the free memory of the budget, and the words of a span, a multiple of 64.
  uint64_t memory_bytes = UINT64_MAX;
  uint64_t span_words = NodeSpans::kSpanWords;

 private:
  FileSystem& files_;
  const std::string prefix_;
  std::atomic<uint64_t> bytes_written_{0};
};

// A file without a name. Thread-safe.
class UnnamedFile {
 public:
  explicit UnnamedFile(VerifyScratch& scratch);

  // Returns the path at which the file was created.
  const std::string& path() const { return out_->path(); }
  void write_at(uint64_t offset, std::span<const std::byte> bytes) {
    out_->write_at(offset, bytes);
    scratch_.count_written(bytes.size());
  }
  void read_at(uint64_t offset, std::span<std::byte> bytes) const { in_->read_at(offset, bytes); }

 private:
  VerifyScratch& scratch_;
  TemporaryWork folder_;  // exists until the file has no name; is destroyed after the file
  std::unique_ptr<WritableFile> out_;
  std::unique_ptr<ReadableFile> in_;
};

}  // namespace voxdag
