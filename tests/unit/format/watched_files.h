// A FileSystem that notes every call that changes the disk, and refuses the n-th of them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag {

class WatchedFiles : public FileSystem {
 public:
  // Calls so far: "create PATH", "write OFFSET SIZE", "sync", "close", "rename PATH", ...
  std::vector<std::string> log;
  // The call of this number (from 0) throws Error{kNoSpace}; none by default.
  size_t fail_at = ~size_t{0};

  void note(const std::string& what) {
    log.push_back(what);
    if (log.size() - 1 == fail_at) throw Error(ErrorCode::kNoSpace, "no space: " + what);
  }
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override {
    return system_files().open_read(path);
  }
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    note("create " + path);
    return std::make_unique<Watched>(*this, system_files().create(path));
  }
  std::unique_ptr<WritableFile> open_write(const std::string& path) override {
    return system_files().open_write(path);
  }
  bool exists(const std::string& path) override { return system_files().exists(path); }
  void rename(const std::string& from, const std::string& to) override {
    note("rename " + to);
    system_files().rename(from, to);
  }
  void remove(const std::string& path) override { system_files().remove(path); }
  void make_directories(const std::string& path) override { system_files().make_directories(path); }
  void remove_directory(const std::string& path) override { system_files().remove_directory(path); }
  std::vector<DirectoryEntry> list(const std::string& path) override {
    return system_files().list(path);
  }
  void sync_directory(const std::string& path) override {
    note("sync directory");
    system_files().sync_directory(path);
  }
  void touch(const std::string& path) override { system_files().touch(path); }
  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    return system_files().try_lock(path);
  }
  uint64_t free_space(const std::string& path) override { return system_files().free_space(path); }

 private:
  class Watched : public WritableFile {
   public:
    Watched(WatchedFiles& files, std::unique_ptr<WritableFile> file)
        : files_(files), file_(std::move(file)) {}
    const std::string& path() const override { return file_->path(); }
    void write_at(uint64_t offset, std::span<const std::byte> data) override {
      files_.note("write " + std::to_string(offset) + " " + std::to_string(data.size()));
      file_->write_at(offset, data);
    }
    void sync() override {
      files_.note("sync");
      file_->sync();
    }
    void close() override {
      files_.note("close");
      file_->close();
    }

   private:
    WatchedFiles& files_;
    std::unique_ptr<WritableFile> file_;
  };
};

}  // namespace voxdag
