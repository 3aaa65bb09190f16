// Compresses the blocks of a package with gzip, which browsers can decompress. Each gzip block has
// a checksum of its contents, which detects damage.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace voxdag::query {

// Returns the compressed bytes of `plain`. They depend only on `plain` and on the version of zlib.
std::string gzip_block(std::string_view plain);
// Returns the decompressed bytes. Throws Error{kCorrupt} if `bytes` is damaged, or if the result
// would have more than `max_bytes` bytes.
std::string gunzip_block(std::string_view bytes, size_t max_bytes);

}  // namespace voxdag::query
