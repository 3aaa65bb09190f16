// Writes a package (query/package/package_index.h) and the viewer as one HTML file, which a browser
// can open without a web server.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "core/io/file_system.h"
#include "query/package/write_package.h"
#include "server/site/viewer_site.h"

namespace voxdag::server {

// Maximum size of a package in one HTML file. It is limited because a browser must read the
// complete file before it can show the first picture.
inline constexpr uint64_t kMaxSinglePageBytes = uint64_t{256} << 20;

// Writes the HTML file spec.output, and returns its report. Replaces an existing file only if
// `replace` is true. Calls `make_contents` after it has checked and locked the output. Throws the
// errors of `make_contents`, write_package() and LockedOutputs, and Error{kLimit} if the package is
// larger than kMaxSinglePageBytes.
query::PackageReport write_single_page(const voxdag_reader::File& file, query::PackageSpec spec,
                                       const std::function<PageContents()>& make_contents,
                                       bool replace, FileSystem& files, Progress& progress,
                                       const CancelToken& cancel);

}  // namespace voxdag::server
