// Opens the files that a scene names by URIs (RFC 3986). Also accepts names that other programs
// write, although RFC 3986 does not allow them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag::gltf {

// Returns the paths that `uri` may mean, relative to the folder of the scene file. The most likely
// path comes first: the percent-decoded name. Further paths have slashes instead of backslashes,
// lack the query ("?...") and the fragment ("#..."), or are not decoded. Throws
// Error{kInvalidInput}, beginning with `where`, for a uri that is empty, absolute or has a scheme.
std::vector<std::string> candidate_paths(const std::string& uri, const std::string& where);

// Opens the first of the candidate_paths() that can be opened. If none can, throws the error for
// the first path. The file may be a Git LFS pointer; the caller checks this.
std::unique_ptr<ReadableFile> open_uri(FileSystem& files, const std::string& scene_path,
                                       const std::string& uri, const std::string& where);

}  // namespace voxdag::gltf
