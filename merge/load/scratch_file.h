// Files in the merge's folder, for data that does not fit in memory or must survive a crash.
//
// A file is removed when its ScratchPath is destroyed, unless the file is retained for a later
// run that resumes the merge. Reading returns the words that were written, or throws
// Error{kCorrupt}.
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

class ScratchFolder {
 public:
  // Does not create the folder: make() does.
  ScratchFolder(FileSystem& files, const std::string& path) : files_(files), path_(path) {}
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  FileSystem& files() { return files_; }
  const std::string& path() const { return path_; }
  // Creates the folder if it is missing. Call it before creating a file. Most merges need no file.
  void make();
  // Bytes that this merge has written to files in the folder, including removed files.
  uint64_t bytes_written() const { return bytes_written_; }
  void count_written(uint64_t bytes) { bytes_written_ += bytes; }
  // Returns a new id for a file. The const overload returns the id that the other overload will
  // return next.
  uint32_t next_id() { return next_id_++; }
  uint32_t next_id() const { return next_id_; }
  void set_next_id(uint32_t id) { next_id_ = id; }
  // Removes the files that earlier merges left in this folder, except `names`. Keeps all files
  // whose names do not have the form of a scratch file.
  void remove_all_but(const std::set<std::string>& names);

 private:
  FileSystem& files_;
  const std::string path_;
  uint32_t next_id_ = 0;
  std::atomic<uint64_t> bytes_written_{0};
};

// Owns the file with this name in the folder.
class ScratchPath {
 public:
  ScratchPath(ScratchFolder& folder, std::string name) : folder_(folder), name_(std::move(name)) {}
  // Removes the file unless it is retained.
  ~ScratchPath();
  ScratchPath(const ScratchPath&) = delete;
  ScratchPath& operator=(const ScratchPath&) = delete;

  const std::string& name() const { return name_; }
  std::string path() const { return folder_.path() + "/" + name_; }
  // After this call the file outlives this object.
  void retain() { retained_ = true; }

 private:
  ScratchFolder& folder_;
  const std::string name_;
  bool retained_ = false;
};

// Saved data with which a later merge opens the scratch file again.
struct ScratchFileState {
  uint32_t id = 0;
  uint64_t words = 0;
  std::vector<uint64_t> checksums;  // one for each checksum block
};

// One file of 32-bit words without gaps, written and read at word offsets. Each word is written
// once, by one thread. Several threads may read words written earlier.
class ScratchFile {
 public:
  explicit ScratchFile(ScratchFolder& folder);
  // Opens a file left by an earlier merge, for reading.
  ScratchFile(ScratchFolder& folder, ScratchFileState state);

  void write(uint64_t first_word, std::span<const uint32_t> words);
  // Reads words. Throws Error{kCorrupt} if the words on the disk differ from the written ones.
  void read(uint64_t first_word, std::span<uint32_t> words) const;
  void sync() { out_->sync(); }

  const ScratchFileState& state() const { return state_; }
  const std::shared_ptr<ScratchPath>& path() const { return path_; }
  static std::string name_of(uint32_t id) { return "merge-" + std::to_string(id) + ".tmp"; }

 private:
  // Words per checksum block. A block has 8192 bytes and its checksum 8, so the checksums take a
  // thousandth of the file's size.
  static constexpr uint64_t kBlockWords = 2048;

  ScratchFolder& folder_;
  ScratchFileState state_;
  const std::shared_ptr<ScratchPath> path_;
  std::unique_ptr<WritableFile> out_;
  std::unique_ptr<ReadableFile> in_;
};

}  // namespace voxdag
