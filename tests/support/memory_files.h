// Files in memory, for tests of code that only reads.
#pragma once

#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag::test {

// A read-only file system of named strings.
class MemoryFiles : public FileSystem {
 public:
  std::map<std::string, std::string> contents;

  std::unique_ptr<ReadableFile> open_read(const std::string& path) override {
    const auto found = contents.find(path);
    if (found == contents.end()) throw Error(ErrorCode::kNotFound, "open " + path + ": not there");
    return std::make_unique<File>(path, found->second);
  }
  bool exists(const std::string& path) override { return contents.contains(path); }
  std::optional<FileIdentity> identify(const std::string& path) override {
    const auto found = contents.find(path);
    if (found == contents.end()) return std::nullopt;
    return FileIdentity{0, found->second.size(), 0, 0};
  }
  std::unique_ptr<ReadableFile> open_own(const std::string& path) override {
    return open_read(path);
  }
  bool create_new(const std::string&) override { read_only(); }
  bool rename_new(const std::string&, const std::string&) override { read_only(); }
  std::unique_ptr<WritableFile> create(const std::string&) override { read_only(); }
  std::unique_ptr<WritableFile> open_write(const std::string&) override { read_only(); }
  void rename(const std::string&, const std::string&) override { read_only(); }
  void remove(const std::string&) override { read_only(); }
  void make_directories(const std::string&) override { read_only(); }
  void make_directory(const std::string&) override { read_only(); }
  void remove_directory(const std::string&) override { read_only(); }
  std::vector<DirectoryEntry> list(const std::string&) override { read_only(); }
  void touch(const std::string&) override { read_only(); }
  void sync_directory(const std::string&) override { read_only(); }
  uint64_t free_space(const std::string&) override { return uint64_t{1} << 40; }
  uint64_t device(const std::string&) override { return 0; }
  std::unique_ptr<FileLock> try_lock(const std::string&) override { read_only(); }
  bool is_locked(const std::string&) override { read_only(); }

 private:
  class File : public ReadableFile {
   public:
    File(std::string path, const std::string& bytes) : path_(std::move(path)), bytes_(bytes) {}
    const std::string& path() const override { return path_; }
    uint64_t size() const override { return bytes_.size(); }
    void read_at(uint64_t offset, std::span<std::byte> out) const override {
      if (offset > bytes_.size() || out.size() > bytes_.size() - offset)
        throw Error(ErrorCode::kCorrupt, path_ + " was read past its end");
      if (!out.empty()) std::memcpy(out.data(), bytes_.data() + offset, out.size());
    }

   private:
    const std::string path_;
    const std::string& bytes_;
  };

  [[noreturn]] static void read_only() { throw Error(ErrorCode::kIo, "read-only test files"); }
};

}  // namespace voxdag::test
