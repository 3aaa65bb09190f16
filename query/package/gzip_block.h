// Compression of the blocks of a package, as browsers can decompress them. The checksum in each
// gzip block detects damage.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace voxdag::query {

// The result depends only on `plain` and on the version of zlib.
std::string gzip_block(std::string_view plain);
// Throws Error{kCorrupt} if the bytes are damaged, or if the result has more than `max_bytes`
// bytes.
std::string gunzip_block(std::string_view bytes, size_t max_bytes);

}  // namespace voxdag::query
