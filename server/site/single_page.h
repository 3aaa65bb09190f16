// Writes a package and its viewer as one HTML file, which browsers can open without a web server.
#pragma once

#include <cstdint>
#include <string>

#include "core/io/file_system.h"
#include "query/package/write_package.h"

namespace voxdag::server {

// Maximum size of a package in one file. Browsers read the complete file before the first picture.
inline constexpr uint64_t kMaxSinglePageBytes = uint64_t{256} << 20;

// Writes the file `spec.output`. Replaces an existing file only if `replace` is true. Throws the
// errors of write_package() and LockedOutputs, and Error{kLimit} for a larger package.
query::PackageReport write_single_page(const voxdag_reader::File& file, query::PackageSpec spec,
                                       const std::string& title, bool replace, FileSystem& files,
                                       Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::server
