// The file system of the machine. Counts reads, writes and syncs by path, and simulates a full disk
// or a failing sync on request. Tests may read the counters only while no build runs.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/io/forwarding_files.h"

namespace voxdag {

class MeteredFiles : public ForwardingFiles {
 public:
  MeteredFiles() : ForwardingFiles(system_files()) {}

  std::map<std::string, uint64_t> reads;           // by path: number of calls of read_at()
  std::map<std::string, uint64_t> writes;          // by path: number of calls of write_at()
  std::map<std::string, uint64_t> bytes_read;      // by path
  std::map<std::string, uint64_t> bytes_written;   // by path
  std::map<std::string, uint64_t> bytes_released;  // by path
  std::map<std::string, uint64_t> syncs;           // by path
  std::map<std::string, uint64_t> failing_sync;    // by path: number of the sync that fails, from 1
  std::string full_for;                            // path of a file whose writes fail with kNoSpace
  uint64_t free_bytes = UINT64_MAX;
  std::string other_disk;  // path of a folder that is reported to be on another disk

  std::map<std::string, uint64_t> directory_syncs;  // by path

  void forget_counts() {
    directory_syncs.clear();
    reads.clear();
    writes.clear();
    bytes_read.clear();
    bytes_written.clear();
    bytes_released.clear();
    syncs.clear();
  }

  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return std::make_unique<Writer>(*this, ForwardingFiles::create(path));
  }
  std::unique_ptr<WritableFile> open_write(const std::string& path) override {
    return std::make_unique<Writer>(*this, ForwardingFiles::open_write(path));
  }
  void sync_directory(const std::string& path) override {
    add(directory_syncs, path, 1);
    ForwardingFiles::sync_directory(path);
  }
  uint64_t free_space(const std::string& path) override {
    return std::min(free_bytes, ForwardingFiles::free_space(path));
  }
  uint64_t device(const std::string& path) override {
    return path == other_disk ? UINT64_MAX : ForwardingFiles::device(path);
  }

 private:
  std::unique_ptr<ReadableFile> reader_of(std::unique_ptr<ReadableFile> file) override {
    return std::make_unique<Reader>(*this, std::move(file));
  }
  uint64_t add(std::map<std::string, uint64_t>& counts, const std::string& path, uint64_t more) {
    std::lock_guard lock(mutex_);
    return counts[path] += more;
  }
  uint64_t failing_sync_of(const std::string& path) const {
    const auto found = failing_sync.find(path);
    return found == failing_sync.end() ? 0 : found->second;
  }

  std::mutex mutex_;

  class Reader : public ForwardingReader {
   public:
    Reader(MeteredFiles& files, std::unique_ptr<ReadableFile> file)
        : ForwardingReader(std::move(file)), files_(files) {}
    void read_at(uint64_t offset, std::span<std::byte> out) const override {
      files_.add(files_.reads, path(), 1);
      files_.add(files_.bytes_read, path(), out.size());
      ForwardingReader::read_at(offset, out);
    }

   private:
    MeteredFiles& files_;
  };

  class Writer : public ForwardingWriter {
   public:
    Writer(MeteredFiles& files, std::unique_ptr<WritableFile> file)
        : ForwardingWriter(std::move(file)), files_(files) {}
    void write_at(uint64_t offset, std::span<const std::byte> data) override {
      if (path() == files_.full_for)
        throw Error(ErrorCode::kNoSpace, "write " + path() + ": the test's disk is full");
      files_.add(files_.writes, path(), 1);
      files_.add(files_.bytes_written, path(), data.size());
      ForwardingWriter::write_at(offset, data);
    }
    void release(uint64_t offset, uint64_t bytes) override {
      files_.add(files_.bytes_released, path(), bytes);
      ForwardingWriter::release(offset, bytes);
    }
    void sync() override {
      if (files_.add(files_.syncs, path(), 1) == files_.failing_sync_of(path()))
        throw Error(ErrorCode::kIo, "sync " + path() + ": the test's disk is broken");
    }

   private:
    MeteredFiles& files_;
  };
};

}  // namespace voxdag
