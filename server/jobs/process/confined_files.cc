#include "server/jobs/process/confined_files.h"

#include <cstdlib>
#include <memory>

#include "core/base/error.h"

namespace voxdag::server {

std::string resolved_path(const std::string& path) {
  const std::unique_ptr<char, decltype(&std::free)> resolved(realpath(path.c_str(), nullptr),
                                                             &std::free);
  return resolved ? resolved.get() : "";
}

bool lies_in(const std::string& path, const std::string& place) {
  return !path.empty() && (path == place || (place.ends_with('/') && path.starts_with(place)));
}

ConfinedFiles::ConfinedFiles(FileSystem& files, const std::vector<std::string>& readable)
    : ForwardingFiles(files) {
  for (const std::string& place : readable) {
    std::string resolved = resolved_path(place);
    if (resolved.empty()) continue;
    if (place.ends_with('/') && resolved != "/") resolved += '/';
    readable_.push_back(resolved);
  }
}

std::unique_ptr<ReadableFile> ConfinedFiles::open_read(const std::string& path) {
  const std::string resolved = resolved_path(path);
  if (resolved.empty()) return ForwardingFiles::open_read(path);  // says what is missing
  for (const std::string& place : readable_)
    if (lies_in(resolved, place)) return ForwardingFiles::open_read(resolved);
  throw Error(
      ErrorCode::kInvalidInput,
      path + " lies outside the scene's folder: expected a scene that needs no other files");
}

}  // namespace voxdag::server
