// Files for what does not fit in memory. A file is removed when its object goes; the folder, made
// if it is missing, stays.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/io/file_system.h"

namespace voxdag {

class MergeScratch {
 public:
  MergeScratch(FileSystem& files, const std::string& path) : files_(files), path_(path) {
    files_.make_directories(path_);
  }
  MergeScratch(const MergeScratch&) = delete;
  MergeScratch& operator=(const MergeScratch&) = delete;

  FileSystem& files() { return files_; }
  const std::string& path() const { return path_; }
  // Bytes ever written to its files.
  uint64_t bytes_written() const { return bytes_written_; }
  void count_written(uint64_t bytes) { bytes_written_ += bytes; }
  uint64_t next_file_id() { return next_file_id_++; }

 private:
  FileSystem& files_;
  const std::string path_;
  uint64_t next_file_id_ = 0;
  std::atomic<uint64_t> bytes_written_{0};
};

// One file, of 32-bit words, written and read back by offset; both from several threads at once.
class ScratchFile {
 public:
  explicit ScratchFile(MergeScratch& folder);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  void write(uint64_t first_word, std::span<const uint32_t> words);
  void read(uint64_t first_word, std::span<uint32_t> words) const;

 private:
  MergeScratch& folder_;
  const std::string path_;
  std::unique_ptr<WritableFile> out_;
  std::unique_ptr<ReadableFile> in_;
};

}  // namespace voxdag
