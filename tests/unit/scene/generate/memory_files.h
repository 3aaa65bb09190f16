// Files in memory. Implements the part of FileSystem that writing a scene needs. The simulated disk
// can be full.
#pragma once

#include <map>
#include <memory>
#include <stdexcept>
#include <string>

#include "core/base/error.h"
#include "core/io/file_system.h"

class MemoryFiles : public voxdag::FileSystem {
 public:
  std::map<std::string, std::string> files;
  uint64_t capacity = UINT64_MAX;  // maximum size of a file, in bytes
  bool keep = true;                // false: writes are counted and forgotten
  uint64_t written = 0;
  uint64_t largest_write = 0;

  std::unique_ptr<voxdag::WritableFile> create(const std::string& path) override {
    files[path].clear();
    return std::make_unique<File>(*this, path);
  }
  void rename(const std::string& from, const std::string& to) override {
    files[to] = std::move(files.at(from));
    files.erase(from);
  }
  bool create_new(const std::string& path) override { return files.try_emplace(path).second; }
  bool rename_new(const std::string& from, const std::string& to) override {
    if (exists(to)) return false;
    rename(from, to);
    return true;
  }
  void remove(const std::string& path) override { files.erase(path); }
  bool exists(const std::string& path) override { return files.contains(path); }
  std::optional<voxdag::FileIdentity> identify(const std::string& path) override {
    const auto found = files.find(path);
    if (found == files.end()) return std::nullopt;
    return voxdag::FileIdentity{0, found->second.size(), 0, 0};
  }
  void sync_directory(const std::string&) override {}

  std::unique_ptr<voxdag::ReadableFile> open_read(const std::string&) override { unexpected(); }
  std::unique_ptr<voxdag::ReadableFile> open_own(const std::string&) override { unexpected(); }
  std::unique_ptr<voxdag::WritableFile> open_write(const std::string&) override { unexpected(); }
  void make_directories(const std::string&) override { unexpected(); }
  void make_directory(const std::string&) override { unexpected(); }
  void remove_directory(const std::string&) override { unexpected(); }
  std::vector<voxdag::DirectoryEntry> list(const std::string&) override { unexpected(); }
  void touch(const std::string&) override { unexpected(); }
  std::unique_ptr<voxdag::FileLock> try_lock(const std::string&) override { unexpected(); }
  bool is_locked(const std::string&) override { unexpected(); }
  uint64_t free_space(const std::string&) override { unexpected(); }
  uint64_t device(const std::string&) override { unexpected(); }

 private:
  [[noreturn]] static void unexpected() { throw std::logic_error("not part of writing a scene"); }

  class File : public voxdag::WritableFile {
   public:
    File(MemoryFiles& owner, const std::string& path) : owner_(owner), path_(path) {}
    const std::string& path() const override { return path_; }
    void write_at(uint64_t offset, std::span<const std::byte> data) override {
      if (offset + data.size() > owner_.capacity)
        throw voxdag::Error(voxdag::ErrorCode::kNoSpace, "write " + path_ + ": full");
      owner_.written += data.size();
      owner_.largest_write = std::max<uint64_t>(owner_.largest_write, data.size());
      if (!owner_.keep) return;
      std::string& file = owner_.files.at(path_);
      file.resize(std::max<size_t>(file.size(), offset + data.size()));
      std::copy_n(reinterpret_cast<const char*>(data.data()), data.size(), file.data() + offset);
    }
    void sync() override {}
    void close() override {}

   private:
    MemoryFiles& owner_;
    const std::string path_;
  };
};
