// The folder of a build's job store and temporary files, with an exclusive lock. Only files with
// names that voxdag uses are removed from it. The folder itself is removed when it is empty.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/format/artifact/artifact.h"
#include "core/io/file_system.h"
#include "scheduler/spec/build_spec.h"

namespace voxdag {

// First segment id for cluster tasks. This process uses smaller ids for its segments.
inline constexpr uint32_t kFirstClusterSegment = uint32_t{1} << 24;

class WorkFolder {
 public:
  // Creates the folder and locks it. Throws Error{kIo} with the name of the other process if it
  // still has the folder locked after `max_wait_s`. Throws Error{kInvalidInput} if the folder has
  // files that are not voxdag's.
  WorkFolder(const BuildContext& context, std::string path, double max_wait_s);

  const std::string& path() const { return path_; }
  // True if an earlier build used the folder.
  bool existed_before() const { return existed_before_; }
  // True if the folder had no files when this object was constructed.
  bool was_empty() const { return was_empty_; }
  std::string store_path() const { return store_path(path_); }
  static std::string store_path(const std::string& folder) { return folder + "/job.db"; }
  // Returns the process that has locked the folder, as "process 17 on box"; "" if none has.
  static std::string holder(FileSystem& files, const std::string& folder);
  // Returns the files in `folder` whose names voxdag uses. A build in this folder can remove or
  // change them.
  static std::vector<std::string> files_in(FileSystem& files, const std::string& folder);
  std::string spill_path() const { return path_ + "/triangles.vdspill"; }
  // File for the decoded geometry of a compressed scene.
  static std::string decoded_path(const std::string& folder) { return folder + "/decoded.vdspill"; }
  // Triangles, kept for later runs.
  std::string durable_path() const { return path_ + "/triangles.vddurable"; }
  // The sample rows of a solid.
  std::string rows_path() const { return path_ + "/rows.vddurable"; }
  std::string row_sums_path() const { return path_ + "/rows.vdspill"; }
  // The parts of an enclosed solid that are filled.
  std::string filled_path() const { return path_ + "/filled.vddurable"; }
  // The blocked and the closed positions of an enclosed solid with a radius.
  std::string blocked_path() const { return path_ + "/blocked.vddurable"; }
  std::string closed_path() const { return path_ + "/closed.vddurable"; }
  // The components at the faces of an enclosed solid's parts.
  std::string faces_path() const { return path_ + "/faces.vdspill"; }
  // Colors of cubes of the color grid, kept for later runs.
  std::string colors_path() const { return path_ + "/colors.vddurable"; }
  // The merge's levels in a build that reorders them. The file has the name with ".partial" added.
  std::string merged_path() const { return path_ + "/merged.vdag"; }
  // The frame of the output file's levels (GlobalFileFrame: the header page, then the checksum
  // table), while the attribute sections are made. With it, the service shows the levels in
  // OUT.partial.
  std::string frame_path() const { return frame_path(path_); }
  static std::string frame_path(const std::string& folder) { return folder + "/frame.vddurable"; }
  std::string scratch_path() const { return path_ + "/merge"; }
  // Folder that a cluster build shares with its tasks.
  std::string cluster_path() const { return path_ + "/cluster"; }
  std::unique_ptr<ReadableFile> open_segment(uint32_t id) const;
  // Returns an unused id for this process's segments: one more than the largest existing id below
  // kFirstClusterSegment.
  uint32_t next_segment_id() const;
  // Returns the bytes of the files in the work folder and in its folders `merge` and `cluster`,
  // without the parts of segments that release() has freed. For reports.
  uint64_t bytes() const;

  // Frees the disk space of a part of a segment that is no longer needed. Not thread-safe.
  void release(const SegmentRange& range);

  // Removes the segments for which `is_named` returns false. An interrupted build left them, and no
  // row of the store refers to them.
  void remove_garbage(const std::function<bool(uint32_t segment)>& is_named);
  // Removes the merge's scratch files.
  void empty_scratch();
  // Syncs the names of the folder and of its files. Until the first call, a power cut can remove
  // the folder with its files. Any thread may call it.
  void sync_names();
  // Removes the files of a cluster build. Errors are ignored.
  void remove_cluster_files();
  // Removes spilled triangles. Errors are ignored.
  void remove_spilled() { remove_silently(spill_path()); }
  // Removes durable triangles. Errors are ignored.
  void remove_durable() { remove_silently(durable_path()); }
  // Removes the sample rows of a solid. Errors are ignored.
  void remove_rows() { remove_silently(rows_path()); }
  // Removes the records of the stage `enclose`. Errors are ignored.
  void remove_filled() {
    for (const auto& path : {filled_path(), blocked_path(), closed_path()}) remove_silently(path);
  }
  // Removes stored colors. Errors are ignored.
  void remove_colors() { remove_silently(colors_path()); }
  // Writes the frame of the levels (frame_path()), but does not sync it: readers check its
  // checksums. Errors are ignored.
  void write_frame(std::span<const std::byte> header, std::span<const std::byte> table);
  // Removes the frame of the levels (frame_path()). Errors are ignored.
  void remove_frame() { remove_silently(frame_path()); }
  // Removes the levels of a build that reorders them, and the frame. Errors are ignored.
  void remove_merged() {
    remove_silently(merged_path() + ".partial");
    remove_frame();
  }
  // Removes all files of voxdag, and the folder if it is empty afterwards. Errors are ignored,
  // because remaining files only cost space.
  void remove();

 private:
  // Throws Error if the folder has files that are not voxdag's. Sets existed_before_ and
  // was_empty_.
  void inspect();
  std::vector<std::string> scratch_files() const;
  void remove_if_empty(const std::string& folder);
  void remove_silently(const std::string& path);

  FileSystem& files_;
  const std::string path_;
  bool existed_before_ = false;
  bool was_empty_ = false;
  std::unique_ptr<FileLock> lock_;
  std::map<uint32_t, std::unique_ptr<WritableFile>> released_;  // segments with a freed part
};

}  // namespace voxdag
