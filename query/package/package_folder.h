// The output folder of a package. All files are first written to a temporary folder. A new package
// then gets its final name in one step. If the folder already has a package, its files are replaced
// in an order that always leaves a complete package, so a web server can serve the folder at any
// time.
#pragma once

#include <string>

#include "core/io/file_system.h"
#include "core/io/output_lock.h"
#include "core/io/outputs/temporary_work.h"
#include "query/package/package_index.h"

namespace voxdag::query {

class PackageFolder {
 public:
  // Creates the temporary folder. Removes the temporary folder of a killed process. Throws Error:
  // kIo if another process writes a package to `path`; kInvalidInput if `path` exists and is
  // neither a package nor an empty folder; kNotFound if the parent folder of `path` does not exist.
  PackageFolder(FileSystem& files, const std::string& path);

  // Returns the temporary folder for the files of the new package.
  std::string new_files() const { return work_.path() + "/package"; }
  // Returns a temporary folder for data that is not part of the package.
  std::string scratch() const { return work_.path() + "/scratch"; }
  // Moves the files of new_files() to `path`. `index` is the index of the new package. If `path`
  // already has a package, removes the files that only the old package has. Files that belong to
  // neither package remain.
  void publish(const PackageIndex& index);

 private:
  void update(const PackageIndex& index);

  FileSystem& files_;
  const std::string path_;
  const bool is_left_behind_;
  const OutputLock lock_;
  const TemporaryWork work_;
};

}  // namespace voxdag::query
