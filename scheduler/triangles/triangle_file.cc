#include "scheduler/triangles/triangle_file.h"

#include "core/format/checksum.h"

namespace voxdag {

TriangleFile::TriangleFile(FileSystem& files, std::string path, uint64_t end)
    : files_(files),
      path_(std::move(path)),
      writer_(end ? files.open_write(path_) : files.create(path_)),
      reader_(files.open_own(path_)),
      name_is_durable_(end > 0),
      first_(end),
      end_(end) {
  if (reader_->size() < end)
    throw DamagedTriangles(path_ + " has " + std::to_string(reader_->size()) +
                           " bytes: expected at least " + std::to_string(end));
}

Extent TriangleFile::append(std::span<const std::byte> bytes) {
  Extent extent{0, bytes.size(), checksum64(bytes)};
  {
    std::lock_guard lock(mutex_);
    extent.offset = end_;
    end_ += bytes.size();
  }
  writer_->write_at(extent.offset, bytes);
  return extent;
}

void TriangleFile::read(const Extent& extent, std::span<std::byte> out) const {
  const auto damaged = [&](const std::string& how) {
    return DamagedTriangles(path_ + " at offset " + std::to_string(extent.offset) + " " + how +
                            ": expected the triangles that were written there");
  };
  try {
    reader_->read_at(extent.offset, out);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCorrupt) throw;
    throw damaged("ends too early");
  }
  if (checksum64(out) != extent.checksum) throw damaged("fails its checksum");
}

void TriangleFile::release(const Extent& extent) { writer_->release(extent.offset, extent.bytes); }

void TriangleFile::sync() {
  writer_->sync();
  if (!name_is_durable_) files_.sync_directory(parent_directory(path_));
  name_is_durable_ = true;
}

uint64_t TriangleFile::end() const {
  std::lock_guard lock(mutex_);
  return end_;
}

}  // namespace voxdag
