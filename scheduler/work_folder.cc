#include "scheduler/work_folder.h"

#include <string_view>

#include "core/base/error.h"
#include "core/format/artifact.h"

namespace voxdag {
namespace {

bool is_ours(const DirectoryEntry& entry) {
  const std::string_view name = entry.name;
  if (entry.is_directory) return name == "merge";
  return name.ends_with(".vdseg") || name.ends_with(".vdspill") || name.ends_with(".vdmap");
}

}  // namespace

WorkFolder::WorkFolder(FileSystem& files, std::string path)
    : files_(files), path_(std::move(path)) {
  files_.make_directories(path_);
  for (const DirectoryEntry& entry : files_.list(path_))
    if (!is_ours(entry))
      throw Error(ErrorCode::kInvalidInput, "the work folder " + path_ + " holds " + entry.name +
                                                ", which voxdag did not make: expected an empty "
                                                "folder or that of an earlier build (--work)");
  remove_ours();
  files_.make_directories(scratch_path());
}

WorkFolder::~WorkFolder() {
  if (keep_) return;
  try {
    remove_ours();
    files_.remove_directory(path_);
  } catch (const Error&) {
    // What cannot be removed costs space, not correctness.
  }
}

void WorkFolder::remove_ours() {
  for (const DirectoryEntry& entry : files_.list(path_)) {
    if (!is_ours(entry)) continue;
    const std::string path = path_ + "/" + entry.name;
    if (!entry.is_directory) {
      files_.remove(path);
      continue;
    }
    for (const DirectoryEntry& inner : files_.list(path))
      if (!inner.is_directory && is_ours(inner)) files_.remove(path + "/" + inner.name);
    files_.remove_directory(path);
  }
}

std::shared_ptr<ReadableFile> WorkFolder::open_segment(uint32_t id) const {
  return files_.open_read(segment_path(path_, id));
}

}  // namespace voxdag
