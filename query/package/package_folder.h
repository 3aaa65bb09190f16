// The folder of a package while it is written. A new package is written to a temporary folder and
// then gets its name in one step. The files of an existing package are replaced in an order in
// which web servers can serve the folder at any time.
#pragma once

#include <string>

#include "core/io/file_system.h"
#include "core/io/output_lock.h"
#include "query/dag/temporary_work.h"
#include "query/package/package_index.h"

namespace voxdag::query {

class PackageFolder {
 public:
  // Throws Error: kIo if another process writes the same package; kInvalidInput if `path` exists
  // and is neither a package nor an empty folder; kNotFound if its parent folder does not exist.
  // Removes the temporary folder of a killed process.
  PackageFolder(FileSystem& files, const std::string& path);

  // Returns the folder to which the files of the package are written.
  std::string new_files() const { return work_.path() + "/package"; }
  // Returns a folder for temporary files.
  std::string scratch() const { return work_.path() + "/scratch"; }
  // Moves the files of new_files() to their final folder. If the folder already has a package,
  // removes the files of this package that the new one does not have. All other files remain.
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
