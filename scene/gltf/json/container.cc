#include "scene/gltf/json/container.h"

#include <algorithm>
#include <span>
#include <string_view>

#include "core/base/error.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

constexpr uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr uint32_t kBinChunk = 0x004E4942;   // "BIN"
constexpr uint64_t kHeaderBytes = 12;
constexpr uint64_t kChunkHeaderBytes = 8;
constexpr uint64_t kMaxJsonBytes = uint64_t{1} << 30;

uint32_t read_u32(const ReadableFile& file, uint64_t offset) {
  std::array<std::byte, 4> b;
  file.read_at(offset, b);
  uint32_t value = 0;
  for (size_t i = 4; i-- > 0;) value = value << 8 | std::to_integer<uint32_t>(b[i]);
  return value;
}

// True for blanks, line ends, zeros and Ctrl-Z. Some programs pad JSON with zeros, or end it with
// Ctrl-Z.
bool is_filler(std::byte b) {
  return b == std::byte{0} || b == std::byte{' '} || b == std::byte{'\t'} || b == std::byte{'\n'} ||
         b == std::byte{'\r'} || b == std::byte{0x1a};
}

// Returns the range without zeros and white space at its end.
FileRange without_padding(const ReadableFile& file, FileRange range) {
  std::array<std::byte, 4096> window;
  while (range.size > 0) {
    const size_t n = static_cast<size_t>(std::min<uint64_t>(range.size, window.size()));
    const std::span<std::byte> bytes(window.data(), n);
    file.read_at(range.begin + range.size - n, bytes);
    const auto last = std::find_if_not(bytes.rbegin(), bytes.rend(), is_filler);
    range.size -= static_cast<uint64_t>(last - bytes.rbegin());
    if (last != bytes.rend()) break;
  }
  return range;
}

struct Chunk {
  uint32_t type = 0;
  FileRange content;
};

// Reads the chunk header at `offset` of a GLB that ends at `end`.
Chunk read_chunk(const ReadableFile& file, uint64_t offset, uint64_t end) {
  if (end - offset < kChunkHeaderBytes)
    refuse(file.path(), "the GLB ends inside the header of a chunk at byte " +
                            std::to_string(offset) + ", expected 8 bytes there");
  const uint64_t length = read_u32(file, offset);
  const uint64_t begin = offset + kChunkHeaderBytes;
  if (length > end - begin)
    refuse(file.path(), "the GLB chunk at byte " + std::to_string(offset) + " declares " +
                            std::to_string(length) + " bytes, expected at most " +
                            std::to_string(end - begin) + ", the rest of the file");
  return {read_u32(file, offset + 4), {begin, length}};
}

// Returns the offset of the next chunk after a chunk that ends at `end_of_chunk`. This offset is
// usually `end_of_chunk` itself. But some programs do not count a chunk's padding in its length. So
// if the chunk BIN begins only at the next multiple of four, returns that multiple.
uint64_t next_chunk(const ReadableFile& file, uint64_t end_of_chunk, uint64_t end) {
  const auto is_bin = [&](uint64_t at) {
    return at + kChunkHeaderBytes <= end && read_u32(file, at + 4) == kBinChunk;
  };
  const uint64_t aligned = (end_of_chunk + 3) / 4 * 4;
  return !is_bin(end_of_chunk) && is_bin(aligned) ? aligned : end_of_chunk;
}

// True if the bytes from `offset` to `end` are too few for a chunk, and all zero or blank.
bool is_padding(const ReadableFile& file, uint64_t offset, uint64_t end) {
  if (end - offset >= kChunkHeaderBytes) return false;
  std::array<std::byte, kChunkHeaderBytes> bytes{};
  file.read_at(offset, std::span(bytes).first(static_cast<size_t>(end - offset)));
  return std::ranges::all_of(bytes, [](std::byte b) { return is_filler(b); });
}

Container read_glb(const ReadableFile& file) {
  if (file.size() < kHeaderBytes)
    refuse(file.path(), "the GLB ends inside its header, at byte " + std::to_string(file.size()) +
                            ", expected at least " + std::to_string(kHeaderBytes) + " bytes");
  const uint32_t version = read_u32(file, 4);
  if (version != 2)
    refuse(file.path(), "is GLB version " + std::to_string(version) + ", expected version 2");
  const uint64_t end = read_u32(file, 8);
  if (end > file.size())
    refuse(file.path(), "is cut off: it has " + std::to_string(file.size()) + " bytes, expected " +
                            std::to_string(end) + ", the length in its GLB header");
  if (end < kHeaderBytes)
    refuse(file.path(), "declares a GLB length of " + std::to_string(end) +
                            " bytes, expected at least " + std::to_string(kHeaderBytes) +
                            ", the bytes of its header");
  const Chunk json = read_chunk(file, kHeaderBytes, end);
  if (json.type != kJsonChunk)
    refuse(file.path(),
           "the first chunk of the GLB is not JSON, expected the chunk type 0x4E4F534A");
  Container container{json.content, false, {}};
  // Chunks of other types may come before BIN. The padding after the last chunk may be incomplete.
  uint64_t next = next_chunk(file, json.content.begin + json.content.size, end);
  while (!container.has_bin && next < end && !is_padding(file, next, end)) {
    const Chunk chunk = read_chunk(file, next, end);
    container.has_bin = chunk.type == kBinChunk;
    if (container.has_bin) container.bin = chunk.content;
    next = next_chunk(file, chunk.content.begin + chunk.content.size, end);
  }
  return container;
}

bool is_glb(const ReadableFile& file) { return file.size() >= 4 && read_u32(file, 0) == kMagic; }

}  // namespace

bool is_gltf(const ReadableFile& file) {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  std::array<char, 256> text{};
  const size_t size = std::min<uint64_t>(text.size(), file.size());
  file.read_at(0, std::as_writable_bytes(std::span(text).first(size)));
  std::string_view begin(text.data(), size);
  if (begin.starts_with(kMark)) begin.remove_prefix(kMark.size());
  begin.remove_prefix(std::min(begin.find_first_not_of(" \t\r\n"), begin.size()));
  return is_glb(file) || begin.starts_with('{') || begin.starts_with('[');
}

Container read_container(const ReadableFile& file) {
  Container container = is_glb(file) ? read_glb(file) : Container{{0, file.size()}, false, {}};
  if (container.json.size > kMaxJsonBytes)
    throw Error(ErrorCode::kLimit, file.path() + ": its JSON has " +
                                       std::to_string(container.json.size) +
                                       " bytes, the limit is 1 GiB");
  container.json = without_padding(file, container.json);
  return container;
}

}  // namespace voxdag::gltf
