#include "query/package/gzip_block.h"

#include <zlib.h>

#include <algorithm>

#include "core/base/error.h"

namespace voxdag::query {
namespace {

constexpr int kBlockLevel = 6;
constexpr int kGzipWindowBits = 15 + 16;  // zlib: 15 for a window of 32 KiB, + 16 for gzip's header
constexpr int kMemoryLevel = 8;
constexpr size_t kFirstBytes = size_t{64} << 10;

void set_input(z_stream& stream, std::string_view bytes) {
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
}

}  // namespace

std::string gzip_block(std::string_view plain) {
  z_stream stream{};
  if (deflateInit2(&stream, kBlockLevel, Z_DEFLATED, kGzipWindowBits, kMemoryLevel,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    throw Error(
        ErrorCode::kOutOfMemory,
        "out of memory: zlib cannot compress a block of the package: expected more free memory "
        "on this machine");
  std::string out(deflateBound(&stream, plain.size()), '\0');
  set_input(stream, plain);
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  // One call compresses all bytes, because `out` is large enough for the worst case
  // (deflateBound()).
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::string gunzip_block(std::string_view bytes, size_t max_bytes) {
  z_stream stream{};
  if (inflateInit2(&stream, kGzipWindowBits) != Z_OK)
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: zlib cannot decompress a block of the package: expected more free "
                "memory on this machine");
  set_input(stream, bytes);
  std::string out(std::min(max_bytes, kFirstBytes), '\0');
  int status = Z_OK;
  while (status == Z_OK) {
    if (stream.total_out == out.size()) {
      if (out.size() == max_bytes) break;
      out.resize(std::min(max_bytes, 2 * out.size()));
    }
    stream.next_out = reinterpret_cast<Bytef*>(out.data()) + stream.total_out;
    stream.avail_out = static_cast<uInt>(out.size() - stream.total_out);
    status = inflate(&stream, Z_NO_FLUSH);
  }
  out.resize(stream.total_out);
  const bool is_complete = status == Z_STREAM_END && stream.avail_in == 0;
  inflateEnd(&stream);
  if (!is_complete)
    throw Error(ErrorCode::kCorrupt,
                "the gzip data are damaged: expected one complete gzip stream with a matching "
                "checksum, of at most " +
                    std::to_string(max_bytes) + " bytes when decompressed");
  return out;
}

}  // namespace voxdag::query
