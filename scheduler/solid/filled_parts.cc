#include "scheduler/solid/filled_parts.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "core/format/cube_bytes.h"

namespace voxdag {
namespace {

constexpr uint64_t kFilledMagic = 0x31646c6966647876ull;
constexpr uint64_t kMaxFilledBytes = uint64_t{1} << 32;

}  // namespace

FilledParts::FilledParts(FileSystem& files, std::string path, std::string identity)
    : files_(files), path_(std::move(path)), identity_(std::move(identity)) {}

void FilledParts::load() {
  if (!files_.exists(path_)) return;
  try {
    const std::string text = read_own_file(files_, path_, kMaxFilledBytes);
    if (decode(std::as_bytes(std::span(text)))) return;
  } catch (const Error& error) {
    if (!error.is_corruption()) throw;
  }
  parts_.clear();
  is_complete_ = false;
}

void FilledParts::forget() {
  parts_.clear();
  segments_.clear();
  is_complete_ = is_saved_ = false;
  if (files_.exists(path_)) files_.remove(path_);
}

std::optional<FilledPart> FilledParts::find(const Cube& cube) const {
  const std::lock_guard lock(mutex_);
  const auto found = parts_.find(cube);
  if (found == parts_.end()) return std::nullopt;
  return found->second;
}

void FilledParts::add_durable(const std::vector<FilledPart>& parts) {
  const std::lock_guard lock(mutex_);
  for (const FilledPart& part : parts) parts_[part.cube] = part;
  write();
}

void FilledParts::complete(std::vector<FilledPart> parts,
                           std::vector<std::unique_ptr<SegmentWriter>> segments) {
  parts_.clear();
  for (const FilledPart& part : parts) parts_[part.cube] = part;
  segments_ = std::move(segments);
  is_complete_ = true;
  is_saved_ = false;
}

std::vector<FilledPart> FilledParts::parts() const {
  const std::lock_guard lock(mutex_);
  std::vector<FilledPart> out;
  for (const auto& [cube, part] : parts_) out.push_back(part);
  return out;
}

std::vector<ArtifactRef> FilledParts::artifacts() const {
  const std::lock_guard lock(mutex_);
  std::vector<ArtifactRef> artifacts;
  std::set<std::pair<uint32_t, uint64_t>> seen;
  for (const auto& [cube, part] : parts_)
    if (seen.insert({part.artifact.segment, part.artifact.offset}).second)
      artifacts.push_back(part.artifact);
  return artifacts;
}

void FilledParts::save() {
  const std::lock_guard lock(mutex_);
  if (!is_complete_ || is_saved_) return;
  for (const auto& segment : segments_) segment->sync_written();
  write();
  is_saved_ = true;
}

bool FilledParts::names_segment(uint32_t segment) const {
  const std::lock_guard lock(mutex_);
  return std::ranges::any_of(
      parts_, [&](const auto& entry) { return entry.second.artifact.segment == segment; });
}

void FilledParts::write() const {
  const std::vector<std::byte> bytes = encode();
  write_file_atomically(files_, path_, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

std::vector<std::byte> FilledParts::encode() const {
  std::vector<std::byte> bytes;
  ByteSink sink(bytes);
  sink.put(kFilledMagic);
  sink.put(static_cast<uint64_t>(identity_.size()));
  sink.put_bytes(std::as_bytes(std::span(identity_)));
  sink.put(static_cast<uint32_t>(is_complete_));
  sink.put(static_cast<uint64_t>(parts_.size()));
  for (const auto& [cube, part] : parts_) {
    put_cube(sink, cube);
    const ArtifactRef& ref = part.artifact;
    sink.put(ref.segment);
    for (const uint64_t word : {ref.offset, ref.bytes, ref.index_offset, ref.checksum, part.voxels})
      sink.put(word);
  }
  sink.put(checksum64(bytes));
  return bytes;
}

bool FilledParts::decode(std::span<const std::byte> bytes) {
  if (bytes.size() < sizeof(uint64_t)) return false;
  const auto content = bytes.first(bytes.size() - sizeof(uint64_t));
  if (ByteSource(bytes.subspan(content.size())).get<uint64_t>() != checksum64(content))
    return false;
  ByteSource source(content);
  if (source.get<uint64_t>() != kFilledMagic) return false;
  const auto identity = source.take(source.get<uint64_t>());
  if (std::string(reinterpret_cast<const char*>(identity.data()), identity.size()) != identity_)
    return false;
  is_complete_ = is_saved_ = source.get<uint32_t>() != 0;
  for (uint64_t n = source.get<uint64_t>(); n > 0 && source.ok(); --n) {
    FilledPart part{get_cube(source), {}, 0};
    ArtifactRef& ref = part.artifact;
    ref.segment = source.get<uint32_t>();
    for (uint64_t* word : {&ref.offset, &ref.bytes, &ref.index_offset, &ref.checksum, &part.voxels})
      *word = source.get<uint64_t>();
    parts_[part.cube] = part;
  }
  return source.ok();
}

}  // namespace voxdag
