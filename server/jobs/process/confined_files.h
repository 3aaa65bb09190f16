// A file system that reads only the files it was given: an uploaded scene may name any file as its
// buffers, by dots or through symbolic links. Everything else passes through.
#pragma once

#include <string>
#include <vector>

#include "core/io/forwarding_files.h"

namespace voxdag::server {

class ConfinedFiles : public ForwardingFiles {
 public:
  // `readable`: files, or folders ending in '/' with all below them. What does not exist yet must
  // be named without symbolic links and dots.
  ConfinedFiles(FileSystem& files, const std::vector<std::string>& readable);

  // Opens a file under the name given, which is the one that errors name. Throws
  // Error{kInvalidInput} for a file outside.
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override;

 private:
  std::vector<std::string> readable_;  // resolved
};

// The path without symbolic links and dots; "" if nothing exists there.
std::string resolved_path(const std::string& path);
// True if a resolved path is `place` or, if that ends in '/', below it.
bool is_within(const std::string& path, const std::string& place);

}  // namespace voxdag::server
