// The folder of a build's temporary files. Only files that voxdag made, known by their names, are
// ever removed from it; the folder itself goes when nothing else is left.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "core/io/file_system.h"

namespace voxdag {

class WorkFolder {
 public:
  // Makes the folder, and empties it of what an interrupted build left. Throws
  // Error{kInvalidInput} if the folder holds files of somebody else.
  WorkFolder(FileSystem& files, std::string path);
  // Removes our files, and the folder if it is empty then, unless keep() was called. Silent: what
  // cannot be removed stays.
  ~WorkFolder();

  const std::string& path() const { return path_; }
  std::string spill_path() const { return path_ + "/triangles.vdspill"; }
  std::string scratch_path() const { return path_ + "/merge"; }
  std::shared_ptr<ReadableFile> open_segment(uint32_t id) const;
  void keep() { keep_ = true; }

 private:
  void remove_ours();

  FileSystem& files_;
  const std::string path_;
  bool keep_ = false;
};

}  // namespace voxdag
