// A file system that fails on request, modeled on LevelDB's fault_injection_test. It simulates a
// disk that is full or loses unsynced data, and a process that is killed.
//
// Each call that changes the disk is an operation. Operations are numbered from 1, in the order in
// which they begin. With several threads, this order differs slightly between runs. Thread-safe.
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
  kNoSpace,     // this write and all later writes are half done and fail with Error{kNoSpace}
  kIoError,     // this and all later operations fail with Error{kIo}; a write is half done
  kFlipBit,     // if the operation is a write, one bit of the written data is wrong
  kReadError,   // this read and all later reads fail with Error{kIo}
};

struct FaultPlan {
  Fault fault = Fault::kNone;
  uint64_t at = 0;  // number of the operation that fails; for kReadError, number of the read
};

class FaultyFiles : public voxdag::ForwardingFiles {
 public:
  explicit FaultyFiles(FaultPlan plan)
      : voxdag::ForwardingFiles(voxdag::system_files()), plan_(plan) {}
  uint64_t operations() const { return operations_; }
  uint64_t reads() const { return reads_; }

  std::unique_ptr<voxdag::WritableFile> create(const std::string& path) override;
  std::unique_ptr<voxdag::WritableFile> open_write(const std::string& path) override;
  bool create_new(const std::string& path) override;
  void rename(const std::string& from, const std::string& to) override;
  bool rename_new(const std::string& from, const std::string& to) override;
  void remove(const std::string& path) override;
  void sync_directory(const std::string& path) override;

 private:
  friend class FaultyWriter;
  friend class FaultyReader;
  std::unique_ptr<voxdag::ReadableFile> reader_of(
      std::unique_ptr<voxdag::ReadableFile> file) override;
  // Gives the operation its number. Then runs the operation, or causes the planned fault. `half`
  // does the part of the operation that a failing disk still does.
  template <class Operation, class Half>
  void operate(const Operation& operation, const Half& half);
  template <class Operation>
  void operate(const Operation& operation) {
    operate([&](uint64_t) { operation(); }, [] {});
  }
  // Like operate(), for a write. `half` writes the part that a failing disk still writes. `flipped`
  // writes the data with one wrong bit.
  template <class Operation, class Half, class Flipped>
  void write(const Operation& operation, const Half& half, const Flipped& flipped);
  void read();
  // Renames a file, and records the old name and a replaced file, so that cut_power() can restore
  // them.
  void rename_unsynced(const std::string& from, const std::string& to);
  // Reverts files and names to their state at the last sync, then sends SIGKILL.
  void cut_power();

  const FaultPlan plan_;
  std::atomic<uint64_t> operations_{0};
  std::atomic<uint64_t> reads_{0};
  std::mutex mutex_;                                   // guards the members below
  std::map<std::string, std::string> synced_;          // written files: contents at the last sync
  std::map<std::string, std::string> unsynced_names_;  // new name -> old name, "" for a new file
  std::map<std::string, std::string> replaced_;        // contents of files replaced by a rename
};

}  // namespace crash
