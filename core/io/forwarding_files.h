// A file system and files that forward every call to another file system or file. A derived class
// overrides only the calls that it changes.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag {

class ForwardingFiles : public FileSystem {
 public:
  // `files` must outlive this object.
  explicit ForwardingFiles(FileSystem& files) : files_(files) {}

  std::unique_ptr<ReadableFile> open_read(const std::string& path) override {
    return reader_of(files_.open_read(path));
  }
  std::unique_ptr<ReadableFile> open_own(const std::string& path) override {
    return reader_of(files_.open_own(path));
  }
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return files_.create(path);
  }
  std::unique_ptr<WritableFile> open_write(const std::string& path) override {
    return files_.open_write(path);
  }
  bool create_new(const std::string& path) override { return files_.create_new(path); }
  bool exists(const std::string& path) override { return files_.exists(path); }
  std::optional<FileIdentity> identify(const std::string& path) override {
    return files_.identify(path);
  }
  void rename(const std::string& from, const std::string& to) override { files_.rename(from, to); }
  bool rename_new(const std::string& from, const std::string& to) override {
    return files_.rename_new(from, to);
  }
  void remove(const std::string& path) override { files_.remove(path); }
  void make_directories(const std::string& path) override { files_.make_directories(path); }
  void make_directory(const std::string& path) override { files_.make_directory(path); }
  void remove_directory(const std::string& path) override { files_.remove_directory(path); }
  std::vector<DirectoryEntry> list(const std::string& path) override { return files_.list(path); }
  void touch(const std::string& path) override { files_.touch(path); }
  void sync_directory(const std::string& path) override { files_.sync_directory(path); }
  std::unique_ptr<FileLock> try_lock(const std::string& path) override {
    return files_.try_lock(path);
  }
  bool is_locked(const std::string& path) override { return files_.is_locked(path); }
  uint64_t free_space(const std::string& path) override { return files_.free_space(path); }
  uint64_t device(const std::string& path) override { return files_.device(path); }

 protected:
  FileSystem& files() { return files_; }
  // Returns the reader for a file that open_read() or open_own() opened. A derived class that
  // changes reads overrides this function.
  virtual std::unique_ptr<ReadableFile> reader_of(std::unique_ptr<ReadableFile> file) {
    return file;
  }

 private:
  FileSystem& files_;
};

class ForwardingReader : public ReadableFile {
 public:
  explicit ForwardingReader(std::unique_ptr<ReadableFile> file) : file_(std::move(file)) {}

  const std::string& path() const override { return file_->path(); }
  uint64_t size() const override { return file_->size(); }
  FileIdentity identity() const override { return file_->identity(); }
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    file_->read_at(offset, out);
  }

 private:
  const std::unique_ptr<ReadableFile> file_;
};

class ForwardingWriter : public WritableFile {
 public:
  explicit ForwardingWriter(std::unique_ptr<WritableFile> file) : file_(std::move(file)) {}

  const std::string& path() const override { return file_->path(); }
  void write_at(uint64_t offset, std::span<const std::byte> data) override {
    file_->write_at(offset, data);
  }
  void release(uint64_t offset, uint64_t bytes) override { file_->release(offset, bytes); }
  void sync() override { file_->sync(); }
  void close() override { file_->close(); }

 private:
  const std::unique_ptr<WritableFile> file_;
};

}  // namespace voxdag
