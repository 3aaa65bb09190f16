// Protects files of other programs from being overwritten by a command: files that these programs
// create or change at the command's output paths while the command runs. This matters because a
// command checks its outputs at the start, and writes some of them only hours later.
//
// The command guards its output paths, including the temporary names, then checks them, and writes
// all outputs through this file system. create(), rename() and remove() of a guarded path accept
// only the file that existed when the path was guarded, and files that this object created.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "core/io/forwarding_files.h"

namespace voxdag {

class GuardedOutputs : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;

  // Guards `path` from now on. The file at `path`, if any, may be replaced.
  void guard(const std::string& path);
  // Guards `path` and its temporary name, `path` + ".partial".
  void guard_output(const std::string& path);
  // True if no other program has created, changed or removed the file at any guarded path.
  bool is_unchanged();

  // These functions throw Error{kInvalidInput} if they would change a file of another program.
  std::unique_ptr<WritableFile> create(const std::string& path) override;
  void rename(const std::string& from, const std::string& to) override;
  void remove(const std::string& path) override;

 private:
  // The file that may be replaced at a guarded path.
  struct Replaceable {
    bool exists = false;
    bool is_own = false;  // created by this object: its size and times can change
    FileIdentity identity;
  };

  std::optional<Replaceable> find(const std::string& path);
  void set(const std::string& path, const Replaceable& replaceable);
  // Returns the file at `path`, if it is a regular file.
  Replaceable file_at(const std::string& path, bool is_own);
  // True if `expected` still is the file at `path`.
  bool is_at(const std::string& path, const Replaceable& expected);

  std::mutex mutex_;
  std::map<std::string, Replaceable> guarded_;
};

}  // namespace voxdag
