#include "scene/generate/glb_writer.h"

#include <bit>
#include <cstring>

#include "core/base/error.h"
#include "scene/generate/glb_layout.h"

namespace voxdag {
namespace {

static_assert(std::endian::native == std::endian::little,
              "arrays are written as they are in memory");

constexpr size_t kBufferBytes = 1 << 20;
constexpr uint64_t kHeaderBytes = 12, kChunkHeadBytes = 8;
constexpr uint32_t kMagic = 0x46546c67, kJsonChunk = 0x4e4f534a, kBinChunk = 0x004e4942;

}  // namespace

GlbWriter::GlbWriter(FileSystem& files, const std::string& path, const std::string& json,
                     uint64_t bin_bytes, Progress& progress, const CancelToken& cancel)
    : files_(files),
      path_(path),
      total_bytes_(kHeaderBytes + kChunkHeadBytes + json.size() + kChunkHeadBytes + bin_bytes),
      progress_(progress),
      cancel_(cancel) {
  if (total_bytes_ > kMaxGlbBytes)
    throw Error(ErrorCode::kLimit, path +
                                       ": the limit of a .glb is 4 294 967 295 bytes, this scene "
                                       "takes " +
                                       std::to_string(total_bytes_));
  file_ = files.create(path + ".partial");
  buffer_.reserve(kBufferBytes);
  for (uint64_t v :
       {uint64_t{kMagic}, uint64_t{2}, total_bytes_, uint64_t{json.size()}, uint64_t{kJsonChunk}})
    put_u32(v);
  put(json.data(), json.size());
  put_u32(bin_bytes);
  put_u32(kBinChunk);
}

GlbWriter::~GlbWriter() {
  if (finished_ || !file_) return;
  try {
    file_.reset();
    files_.remove(path_ + ".partial");
  } catch (const Error&) {
    // Ignored, because the error that ended the writing is reported.
  }
}

void GlbWriter::instances(uint32_t, std::span<const Float3> translations,
                          std::span<const Float3> scales) {
  put(translations.data(), translations.size_bytes());
  put(scales.data(), scales.size_bytes());
}

void GlbWriter::write_geometry(const MeshBuilder& mesh) {
  cancel_.check();
  put(mesh.positions.data(), mesh.positions.size() * sizeof(Float3));
  put(mesh.colors.data(), mesh.colors.size() * sizeof(Rgba8));
  const size_t bytes = mesh.indices.size() * sizeof(uint16_t);
  put(mesh.indices.data(), bytes);
  const std::byte padding[4] = {};
  put(padding, padded_index_bytes(mesh.indices.size()) - bytes);
  progress_.advance(mesh.triangles());
}

void GlbWriter::put(const void* data, size_t bytes) {
  const auto* from = static_cast<const std::byte*>(data);
  while (bytes > 0) {
    const size_t n = std::min(bytes, kBufferBytes - buffer_.size());
    buffer_.insert(buffer_.end(), from, from + n);
    from += n;
    bytes -= n;
    if (buffer_.size() == kBufferBytes) flush();
  }
}

void GlbWriter::put_u32(uint64_t value) {
  const auto v = static_cast<uint32_t>(value);
  put(&v, sizeof v);
}

void GlbWriter::flush() {
  file_->write_at(written_, buffer_);
  written_ += buffer_.size();
  buffer_.clear();
}

uint64_t GlbWriter::finish() {
  flush();
  file_->sync();
  file_->close();
  files_.rename(path_ + ".partial", path_);
  finished_ = true;
  files_.sync_directory(parent_directory(path_));
  return written_;
}

}  // namespace voxdag
