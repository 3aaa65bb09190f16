// The complete DAG of a running job that still computes colors or other attributes. At this time,
// all levels are in the job's partial output file, but the file's header and checksums are not. The
// service reads header and checksums from the *frame*, a file in the work folder
// (WorkFolder::frame_path()). The tiles are the tiles of a file without attributes. Thread-safe.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "core/io/file_system.h"
#include "server/jobs/protocol/job_folder.h"
#include "server/tiles/file_tile_source.h"

namespace voxdag::server {

class MergedLevels : public FileTileSource {
 public:
  // Returns the DAG of the job; null if the job's levels are not merged yet, or if the frame does
  // not belong to the partial file or to `grid_levels`, for example because the job's process is
  // writing it.
  static std::shared_ptr<MergedLevels> open(FileSystem& files, const JobFolder& folder,
                                            uint32_t grid_levels);

  // Sets the manifest. Call it before other threads use this object.
  void set_manifest(std::string manifest) { manifest_ = std::move(manifest); }
  const std::string& manifest(const CancelToken&) const override { return manifest_; }
  // True if a build can have overwritten the mapped levels: the frame was changed or removed, and
  // the mapped file is still the partial file. If the mapped file was renamed or removed, for
  // example because the job has succeeded or was canceled, its levels remain as they are.
  bool was_overwritten() const override;

 private:
  MergedLevels(FileSystem& files, const JobFolder& folder, const FileIdentity& frame,
               std::shared_ptr<const voxdag_reader::Bytes> bytes, uint64_t inode);

  FileSystem& files_;
  const JobFolder folder_;
  const uint64_t inode_;  // inode of the mapped file
  std::string manifest_;
};

}  // namespace voxdag::server
