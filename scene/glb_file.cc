#include "scene/glb_file.h"

#include <algorithm>
#include <bit>
#include <span>

#include "core/base/error.h"

namespace voxdag {
namespace {

static_assert(std::endian::native == std::endian::little,
              "arrays are written as they are in memory");

constexpr size_t kBufferBytes = 1 << 20;
constexpr uint64_t kHeaderBytes = 12, kChunkHeadBytes = 8;
constexpr uint32_t kMagic = 0x46546c67, kJsonChunk = 0x4e4f534a, kBinChunk = 0x004e4942;

}  // namespace

GlbFile::GlbFile(FileSystem& files, const std::string& path, std::string json, uint64_t bin_bytes)
    : files_(files), path_(path) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const uint64_t bytes = kHeaderBytes + kChunkHeadBytes + json.size() + kChunkHeadBytes + bin_bytes;
  if (bytes > kMaxGlbBytes)
    throw Error(ErrorCode::kLimit, path +
                                       ": the limit of a .glb is 4 294 967 295 bytes, this scene "
                                       "takes " +
                                       std::to_string(bytes) + ": expected fewer triangles");
  file_ = files.create(path + ".partial");
  registered_.emplace(path + ".partial");
  buffer_.reserve(kBufferBytes);
  for (uint64_t v :
       {uint64_t{kMagic}, uint64_t{2}, bytes, uint64_t{json.size()}, uint64_t{kJsonChunk}})
    put_u32(v);
  put(json.data(), json.size());
  put_u32(bin_bytes);
  put_u32(kBinChunk);
}

GlbFile::~GlbFile() {
  if (finished_) return;
  try {
    file_.reset();
    files_.remove(path_ + ".partial");
  } catch (const Error&) {
    // An error here is ignored: the caller reports the error that ended the writing.
  }
}

void GlbFile::put(const void* data, size_t bytes) {
  const auto* from = static_cast<const std::byte*>(data);
  while (bytes > 0) {
    const size_t n = std::min(bytes, kBufferBytes - buffer_.size());
    buffer_.insert(buffer_.end(), from, from + n);
    from += n;
    bytes -= n;
    if (buffer_.size() == kBufferBytes) flush();
  }
}

void GlbFile::put_u32(uint64_t value) {
  const auto v = static_cast<uint32_t>(value);
  put(&v, sizeof v);
}

void GlbFile::flush() {
  file_->write_at(written_, buffer_);
  written_ += buffer_.size();
  buffer_.clear();
}

void GlbFile::sync_and_close() {
  flush();
  file_->sync();
  file_->close();
}

uint64_t GlbFile::finish_partial() {
  sync_and_close();
  finished_ = true;
  registered_.reset();
  return written_;
}

uint64_t GlbFile::finish() {
  sync_and_close();
  files_.rename(path_ + ".partial", path_);
  finished_ = true;
  registered_.reset();
  files_.sync_directory(parent_directory(path_));
  return written_;
}

bool is_glb_of(const ReadableFile& file, const std::string& generator) {
  // The JSON chunks of the largest generated scenes have a few megabytes.
  constexpr uint64_t kMaxDescriptionBytes = 16 << 20;
  std::string start(std::min(file.size(), kMaxDescriptionBytes), '\0');
  file.read_at(0, std::as_writable_bytes(std::span(start)));
  return start.starts_with("glTF") && start.find(generator) != std::string::npos;
}

}  // namespace voxdag
