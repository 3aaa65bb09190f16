#include "server/jobs/process/confined_files.h"

#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "core/base/error.h"

namespace voxdag::server {
namespace {

// True if `opened` is the file at the checked path `resolved`. They can differ, because a symbolic
// link in the path may have changed between check and open.
bool is_same_file(const std::string& resolved, const FileIdentity& opened) {
  struct stat found {};
  return lstat(resolved.c_str(), &found) == 0 && found.st_ino == opened.inode;
}

}  // namespace

std::string resolved_path(const std::string& path) {
  const std::unique_ptr<char, decltype(&std::free)> resolved(realpath(path.c_str(), nullptr),
                                                             &std::free);
  return resolved ? resolved.get() : "";
}

bool is_within(const std::string& path, const std::string& place) {
  return !path.empty() && (path == place || (place.ends_with('/') && path.starts_with(place)));
}

ConfinedFiles::ConfinedFiles(FileSystem& files, const std::vector<std::string>& readable)
    : ForwardingFiles(files) {
  for (const std::string& place : readable) {
    std::string resolved = resolved_path(place);
    if (resolved.empty()) resolved = place;
    if (place.ends_with('/') && !resolved.ends_with('/')) resolved += '/';
    readable_.push_back(resolved);
  }
}

std::unique_ptr<ReadableFile> ConfinedFiles::open_read(const std::string& path) {
  return open_checked(&FileSystem::open_read, path);
}

std::unique_ptr<ReadableFile> ConfinedFiles::open_own(const std::string& path) {
  return open_checked(&FileSystem::open_own, path);
}

std::unique_ptr<ReadableFile> ConfinedFiles::open_checked(Open open, const std::string& path) {
  // Missing files and forbidden files give the same error, so that a scene cannot find out which
  // files exist.
  std::string resolved = resolved_path(path);
  std::error_code failure;
  if (resolved.empty()) resolved = std::filesystem::weakly_canonical(path, failure);
  const bool is_readable =
      std::any_of(readable_.begin(), readable_.end(),
                  [&](const std::string& p) { return is_within(resolved, p); });
  if (is_readable) {
    auto file = (files().*open)(path);
    if (is_same_file(resolved, file->identity())) return file;
  }
  throw Error(ErrorCode::kInvalidInput,
              path + " is outside the scene's folder: expected a scene that needs no other files");
}

}  // namespace voxdag::server
