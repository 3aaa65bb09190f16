// A folder for temporary files next to an output.
#pragma once

#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/io/file_system.h"
#include "core/io/temporary_paths.h"

namespace voxdag {

// Creates a folder whose name is `prefix` and random characters. The destructor removes the folder
// with its contents. If a signal ends the process earlier, remove_temporary_paths()
// (core/io/temporary_paths.h) removes the folder.
class TemporaryWork {
 public:
  TemporaryWork(FileSystem& files, const std::string& prefix)
      : files_(files), path_(make_temporary_folder(prefix)), registered_(path_) {}
  ~TemporaryWork() { remove(); }
  TemporaryWork(const TemporaryWork&) = delete;
  TemporaryWork& operator=(const TemporaryWork&) = delete;
  const std::string& path() const { return path_; }
  // Removes the folder with its contents now. Ignores errors, because the remaining files are
  // harmless; the destructor then tries again.
  void remove() {
    if (!registered_) return;
    try {
      remove_tree(files_, path_);
      registered_.reset();
    } catch (const Error&) {
    }
  }

 private:
  FileSystem& files_;
  const std::string path_;
  std::optional<TemporaryPath> registered_;  // nullopt after the folder was removed
};

}  // namespace voxdag
