// A file system that fails on request, modeled on leveldb's fault_injection_test: a disk that drops
// unsynced data or is full, or a process that is killed.
//
// Every call that changes the disk is an operation. Operations are numbered from 1 in the order in
// which they begin. With several threads, this order differs slightly from run to run. Thread-safe.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "core/base/error.h"
#include "core/io/forwarding_files.h"

namespace crash {

enum class Fault {
  kNone,
  kKillBefore,  // SIGKILL instead of the operation
  kKillAfter,   // SIGKILL once it is done
  kPowerCut,    // unsynced data is dropped, then SIGKILL
  kNoSpace,     // this write and all later ones are half done and fail with Error{kNoSpace}
  kIoError,     // this and all later operations fail with Error{kIo}; a write is half done
  kFlipBit,     // if it is a write, one bit of it lands on the disk flipped
  kReadError,   // this read and all later ones fail with Error{kIo}
};

struct FaultPlan {
  Fault fault = Fault::kNone;
  uint64_t at = 0;  // the operation's number; for kReadError, the read's
};

class FaultyFiles : public voxdag::ForwardingFiles {
 public:
  explicit FaultyFiles(FaultPlan plan)
      : voxdag::ForwardingFiles(voxdag::system_files()), plan_(plan) {}
  uint64_t operations() const { return operations_; }
  uint64_t reads() const { return reads_; }

  std::unique_ptr<voxdag::ReadableFile> open_read(const std::string& path) override;
  std::unique_ptr<voxdag::WritableFile> create(const std::string& path) override;
  std::unique_ptr<voxdag::WritableFile> open_write(const std::string& path) override;
  void rename(const std::string& from, const std::string& to) override;
  void remove(const std::string& path) override;
  void sync_directory(const std::string& path) override;

 private:
  friend class FaultyWriter;
  friend class FaultyReader;
  // Runs one operation, which gets its number, or the planned fault instead. `half` does the part
  // of the operation that a failing disk completes.
  template <class Operation, class Half>
  void operate(const Operation& operation, const Half& half);
  template <class Operation>
  void operate(const Operation& operation) {
    operate([&](uint64_t) { operation(); }, [] {});
  }
  // Runs a write. `half` is a write that the disk does not complete, `flipped` a write with a wrong
  // bit.
  template <class Operation, class Half, class Flipped>
  void write(const Operation& operation, const Half& half, const Flipped& flipped);
  void read();
  // Reverts files and names to their synced state, then sends SIGKILL.
  void cut_power();

  const FaultPlan plan_;
  std::atomic<uint64_t> operations_{0};
  std::atomic<uint64_t> reads_{0};
  std::mutex mutex_;                                   // guards the state after a power cut
  std::map<std::string, std::string> synced_;          // contents, of files that were written here
  std::map<std::string, std::string> unsynced_names_;  // new name -> old name, "" for a new file
  std::map<std::string, std::string> replaced_;        // contents of files whose names those took
};

}  // namespace crash
