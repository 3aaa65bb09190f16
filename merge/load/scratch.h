// Files for what does not fit in memory, or must survive a crash, in a folder of the merge's own.
//
// A file is removed when the last object that refers to its path goes, unless it was told to stay
// for a merge that goes on later. What is read back is what was written, or Error{kCorrupt}.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag {

class MergeScratch {
 public:
  // Makes the folder if it is missing.
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
  // Ids of files are handed out once.
  uint32_t take_id() { return next_id_++; }
  uint32_t next_id() const { return next_id_; }
  void set_next_id(uint32_t id) { next_id_ = id; }
  // Removes what an earlier merge left, but for `names`; only files that bear such names as ours.
  void remove_all_but(const std::set<std::string>& names);

 private:
  FileSystem& files_;
  const std::string path_;
  uint32_t next_id_ = 0;
  std::atomic<uint64_t> bytes_written_{0};
};

// Owns a file's name in the folder.
class ScratchPath {
 public:
  ScratchPath(MergeScratch& folder, std::string name) : folder_(folder), name_(std::move(name)) {}
  ~ScratchPath();
  ScratchPath(const ScratchPath&) = delete;
  ScratchPath& operator=(const ScratchPath&) = delete;

  const std::string& name() const { return name_; }
  std::string path() const { return folder_.path() + "/" + name_; }
  // The file stays when this object goes.
  void keep() { kept_ = true; }

 private:
  MergeScratch& folder_;
  const std::string name_;
  bool kept_ = false;
};

// What it takes to open a scratch file again.
struct ScratchRecord {
  uint32_t id = 0;
  uint64_t words = 0;
  std::vector<uint64_t> sums;  // of each block
};

// One file, of 32-bit words without gaps, written and read back by offset. Each word is written
// once, by one thread at a time; several may read what was written before.
class ScratchFile {
 public:
  explicit ScratchFile(MergeScratch& folder);
  // One that an earlier merge left.
  ScratchFile(MergeScratch& folder, ScratchRecord record);

  void write(uint64_t first_word, std::span<const uint32_t> words);
  // Throws Error{kCorrupt} if the disk gives back other words than were written.
  void read(uint64_t first_word, std::span<uint32_t> words) const;
  void sync() { out_->sync(); }

  const ScratchRecord& record() const { return record_; }
  const std::shared_ptr<ScratchPath>& path() const { return path_; }
  static std::string name_of(uint32_t id) { return "merge-" + std::to_string(id) + ".tmp"; }

 private:
  // Words that are summed together; with 8 bytes a block, sums take a thousandth of the file.
  static constexpr uint64_t kBlockWords = 2048;

  MergeScratch& folder_;
  ScratchRecord record_;
  const std::shared_ptr<ScratchPath> path_;
  std::unique_ptr<WritableFile> out_;
  std::unique_ptr<ReadableFile> in_;
};

}  // namespace voxdag
