#include "scene/gltf/mesh_data/buffer_reader.h"

#include <algorithm>
#include <array>

#include "core/base/error.h"
#include "scene/base64.h"
#include "scene/gltf/uri/file_uri.h"
#include "scene/lfs_pointer.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

// Maximum number of open files of all readers of a scene together. Each reader can have at least
// one open file, even if all readers together then exceed this maximum.
constexpr unsigned kMaxOpenFiles = 32;
constexpr uint64_t kMapNodeBytes = 48;
// Maximum number of base64 groups, which encode three bytes each, in a window. A window may begin
// inside one group and end inside another.
constexpr size_t kMaxGroups = BufferReader::kWindowBytes / 3 + 2;

}  // namespace

void ExternalFiles::add(int buffer, const SourceFile& file) {
  const std::lock_guard lock(mutex_);
  const auto [known, is_new] = by_buffer_.try_emplace(buffer, file);
  if (is_new) charge_.add(sizeof(*known) + kMapNodeBytes + file.path.size());
  const FileIdentity &before = known->second.identity, &now = file.identity;
  if (before.inode != now.inode || before.bytes != now.bytes ||
      before.modified_ns != now.modified_ns)
    throw Error(ErrorCode::kInvalidInput,
                printable(file.path) +
                    " changed while the scene was read: expected files that do not change");
}

std::vector<SourceFile> ExternalFiles::all() const {
  const std::lock_guard lock(mutex_);
  std::vector<SourceFile> files;
  for (const auto& [buffer, file] : by_buffer_) files.push_back(file);
  return files;
}

BufferReader::BufferReader(FileSystem& files, const ReadableFile& scene_file,
                           const Document& document, ExternalFiles& external_files,
                           DecodedBuffers& decoded, MemoryBudget& budget, unsigned readers)
    : files_(files),
      scene_file_(scene_file),
      document_(document),
      external_files_(external_files),
      decoded_(decoded),
      budget_(budget),
      max_open_(std::max(kMaxOpenFiles / readers, 1u)),
      window_(budget, 3 * kMaxGroups, "the window over " + scene_file.path()) {}

void BufferReader::check_lengths() {
  for (size_t i = 0; i < document_.buffers.size(); ++i)
    if (document_.buffers[i].is_read) check_length(static_cast<int>(i));
}

std::span<const std::byte> BufferReader::window(int index, uint64_t offset, size_t size) {
  const BufferSource& buffer = document_.buffers[static_cast<size_t>(index)];
  if (buffer.kind == BufferSource::Kind::kBase64) return decode_base64(index, offset, size);
  if (buffer.kind == BufferSource::Kind::kMemory)
    return std::as_bytes(std::span(buffer.bytes)).subspan(offset, size);
  const std::span<std::byte> bytes(window_.data(), size);
  if (buffer.kind == BufferSource::Kind::kDecoded)
    decoded_.read(index, offset, bytes, [this](int from, uint64_t begin, std::span<std::byte> out) {
      read(from, begin, out);
    });
  else if (buffer.kind == BufferSource::Kind::kBinChunk)
    scene_file_.read_at(buffer.range.begin + offset, bytes);
  else
    external(index).read_at(offset, bytes);
  return bytes;
}

void BufferReader::read(int buffer, uint64_t offset, std::span<std::byte> out) {
  while (!out.empty()) {
    const auto bytes = window(buffer, offset, std::min(kWindowBytes, out.size()));
    std::ranges::copy(bytes, out.begin());
    out = out.subspan(bytes.size());
    offset += bytes.size();
  }
}

void BufferReader::check_length(int index) {
  const BufferSource& buffer = document_.buffers[static_cast<size_t>(index)];
  uint64_t there = 0;
  switch (buffer.kind) {
    case BufferSource::Kind::kNone:
    case BufferSource::Kind::kDecoded:
      return;
    case BufferSource::Kind::kBinChunk:
      there = buffer.range.size;
      break;
    case BufferSource::Kind::kExternal:
      there = external(index).size();
      break;
    case BufferSource::Kind::kMemory:
      there = buffer.bytes.size();
      break;
    case BufferSource::Kind::kBase64: {
      std::array<std::byte, 2> tail{};
      const size_t n = static_cast<size_t>(std::min<uint64_t>(2, buffer.range.size));
      scene_file_.read_at(buffer.range.begin + buffer.range.size - n, std::span(tail).first(n));
      there = base64_bytes(buffer.range.size, std::span(tail).first(n));
      break;
    }
  }
  if (there < buffer.byte_length)
    refuse(document_.path, "buffer " + std::to_string(index) + " has " + std::to_string(there) +
                               " bytes" +
                               (buffer.uri.empty() ? "" : " in " + printable(buffer.uri)) +
                               ", expected " + std::to_string(buffer.byte_length));
}

const ReadableFile& BufferReader::external(int index) {
  const auto found = std::ranges::find(open_, index, &OpenFile::buffer);
  if (found != open_.end()) return *found->file;
  const std::string where = document_.path + ": buffer " + std::to_string(index);
  const std::string& uri = document_.buffers[static_cast<size_t>(index)].uri;
  if (open_.size() == max_open_) open_.erase(open_.begin());
  std::unique_ptr<ReadableFile> file;
  try {
    file = open_uri(files_, document_.path, uri, where);
  } catch (const Error& e) {
    if (e.message().starts_with(where)) throw;
    throw Error(e.code(), where + ": " + e.message());
  }
  refuse_lfs_pointer(*file, where);
  external_files_.add(index, {file->path(), file->identity()});
  open_.push_back({index, std::move(file)});
  return *open_.back().file;
}

std::span<const std::byte> BufferReader::decode_base64(int index, uint64_t offset, size_t size) {
  if (characters_.size() == 0)
    characters_ = PageBuffer<std::byte>(budget_, 4 * kMaxGroups, "base64 of " + document_.path);
  const BufferSource& buffer = document_.buffers[static_cast<size_t>(index)];
  const uint64_t first_group = offset / 3;
  const uint64_t group_count = (offset + size + 2) / 3 - first_group;
  const uint64_t begin = 4 * first_group;
  const uint64_t end = std::min(begin + 4 * group_count, buffer.range.size);
  const std::span<std::byte> characters(characters_.data(), static_cast<size_t>(end - begin));
  scene_file_.read_at(buffer.range.begin + begin, characters);
  if (!voxdag::decode_base64(characters, window_.data()))
    refuse(document_.path,
           "buffer " + std::to_string(index) +
               ": its data: URI has a character that is not base64 among the characters " +
               std::to_string(begin) + " to " + std::to_string(begin + characters.size() - 1) +
               ", expected A-Z a-z 0-9 + / =");
  return {window_.data() + offset % 3, size};
}

}  // namespace voxdag::gltf
