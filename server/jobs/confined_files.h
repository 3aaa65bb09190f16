// A file system that opens nothing but what it was given: a scene that somebody uploaded may name
// any file as its buffers, by dots or through symbolic links. Everything else passes through.
#pragma once

#include <string>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag::server {

class ConfinedFiles : public FileSystem {
 public:
  // `readable`: files, or folders ending in '/' with all below them.
  ConfinedFiles(FileSystem& files, const std::vector<std::string>& readable);

  // Throws Error{kInvalidInput} for a file outside.
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override;
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return files_.create(path);
  }
  std::unique_ptr<WritableFile> open_write(const std::string& path) override {
    return files_.open_write(path);
  }
  bool exists(const std::string& path) override { return files_.exists(path); }
  void rename(const std::string& from, const std::string& to) override { files_.rename(from, to); }
  void remove(const std::string& path) override { files_.remove(path); }
  void make_directories(const std::string& path) override { files_.make_directories(path); }
  void remove_directory(const std::string& path) override { files_.remove_directory(path); }
  std::vector<DirectoryEntry> list(const std::string& path) override { return files_.list(path); }
  void touch(const std::string& path) override { files_.touch(path); }
  void sync_directory(const std::string& path) override { files_.sync_directory(path); }
  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    return files_.try_lock(path);
  }
  uint64_t free_space(const std::string& path) override { return files_.free_space(path); }

 private:
  FileSystem& files_;
  std::vector<std::string> readable_;  // resolved
};

// The path without symbolic links and dots; "" if there is nothing.
std::string resolved_path(const std::string& path);
// A resolved path is `place` or, if that ends in '/', lies below it.
bool lies_in(const std::string& path, const std::string& place);

}  // namespace voxdag::server
