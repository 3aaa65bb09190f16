// A FileSystem that records every call that changes the disk, and lets one of them fail.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/io/forwarding_files.h"

namespace voxdag {

class WatchedFiles : public ForwardingFiles {
 public:
  WatchedFiles() : ForwardingFiles(system_files()) {}

  // The calls so far: "create PATH", "write OFFSET SIZE", "sync", "close", "rename PATH", ...
  std::vector<std::string> log;
  // Number (from 0) of the call that throws Error{kNoSpace}; by default no call fails.
  size_t fail_at = ~size_t{0};

  void note(const std::string& what) {
    log.push_back(what);
    if (log.size() - 1 == fail_at) throw Error(ErrorCode::kNoSpace, "no space: " + what);
  }
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    note("create " + path);
    return std::make_unique<Watched>(*this, ForwardingFiles::create(path));
  }
  void rename(const std::string& from, const std::string& to) override {
    note("rename " + to);
    ForwardingFiles::rename(from, to);
  }
  void sync_directory(const std::string& path) override {
    note("sync directory");
    ForwardingFiles::sync_directory(path);
  }

 private:
  class Watched : public ForwardingWriter {
   public:
    Watched(WatchedFiles& files, std::unique_ptr<WritableFile> file)
        : ForwardingWriter(std::move(file)), files_(files) {}
    void write_at(uint64_t offset, std::span<const std::byte> data) override {
      files_.note("write " + std::to_string(offset) + " " + std::to_string(data.size()));
      ForwardingWriter::write_at(offset, data);
    }
    void sync() override {
      files_.note("sync");
      ForwardingWriter::sync();
    }
    void close() override {
      files_.note("close");
      ForwardingWriter::close();
    }

   private:
    WatchedFiles& files_;
  };
};

}  // namespace voxdag
