// The machine's files, with a meter on what is read and written, and a disk that is full or fails
// where a test wants it to. Syncs are only counted: no test cuts the power.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag {

class MeteredFiles : public FileSystem {
 public:
  std::map<std::string, uint64_t> bytes_read;      // by path
  std::map<std::string, uint64_t> bytes_written;   // by path
  std::map<std::string, uint64_t> bytes_released;  // by path
  std::map<std::string, uint64_t> syncs;           // by path
  std::map<std::string, uint64_t> failing_sync;    // by path, counted from 1: fails with kIo
  std::string full_for;                            // no write to this file finds room
  uint64_t free_bytes = UINT64_MAX;

  void forget_counts() {
    bytes_read.clear();
    bytes_written.clear();
    bytes_released.clear();
    syncs.clear();
  }

  std::unique_ptr<ReadableFile> open_read(const std::string& path) override {
    return std::make_unique<Reader>(*this, system_files().open_read(path));
  }
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return std::make_unique<Writer>(*this, system_files().create(path));
  }
  std::unique_ptr<WritableFile> open_write(const std::string& path) override {
    return std::make_unique<Writer>(*this, system_files().open_write(path));
  }
  bool exists(const std::string& path) override { return system_files().exists(path); }
  void rename(const std::string& from, const std::string& to) override {
    system_files().rename(from, to);
  }
  void remove(const std::string& path) override { system_files().remove(path); }
  void make_directories(const std::string& path) override { system_files().make_directories(path); }
  void remove_directory(const std::string& path) override { system_files().remove_directory(path); }
  std::vector<DirectoryEntry> list(const std::string& path) override {
    return system_files().list(path);
  }
  void touch(const std::string& path) override { system_files().touch(path); }
  void sync_directory(const std::string& path) override { system_files().sync_directory(path); }
  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    return system_files().try_lock(path);
  }
  uint64_t free_space(const std::string& path) override {
    return std::min(free_bytes, system_files().free_space(path));
  }

 private:
  class Reader : public ReadableFile {
   public:
    Reader(MeteredFiles& files, std::unique_ptr<ReadableFile> file)
        : files_(files), file_(std::move(file)) {}
    const std::string& path() const override { return file_->path(); }
    uint64_t size() const override { return file_->size(); }
    FileIdentity identity() const override { return file_->identity(); }
    void read_at(uint64_t offset, std::span<std::byte> out) const override {
      files_.bytes_read[path()] += out.size();
      file_->read_at(offset, out);
    }

   private:
    MeteredFiles& files_;
    const std::unique_ptr<ReadableFile> file_;
  };

  class Writer : public WritableFile {
   public:
    Writer(MeteredFiles& files, std::unique_ptr<WritableFile> file)
        : files_(files), file_(std::move(file)) {}
    const std::string& path() const override { return file_->path(); }
    void write_at(uint64_t offset, std::span<const std::byte> data) override {
      if (path() == files_.full_for)
        throw Error(ErrorCode::kNoSpace, "write " + path() + ": the test's disk is full");
      files_.bytes_written[path()] += data.size();
      file_->write_at(offset, data);
    }
    void release(uint64_t offset, uint64_t bytes) override {
      files_.bytes_released[path()] += bytes;
      file_->release(offset, bytes);
    }
    void sync() override {
      if (++files_.syncs[path()] == files_.failing_sync[path()])
        throw Error(ErrorCode::kIo, "sync " + path() + ": the test's disk is broken");
    }
    void close() override { file_->close(); }

   private:
    MeteredFiles& files_;
    const std::unique_ptr<WritableFile> file_;
  };
};

}  // namespace voxdag
