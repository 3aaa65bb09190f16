#include "scheduler/solid/row_file.h"

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/format/checksum.h"
#include "scheduler/solid/row_codec.h"

namespace voxdag {
namespace {

[[noreturn]] void refuse_damage(const std::string& path, const RowExtent& extent) {
  throw Error(ErrorCode::kCorrupt, path + ": the rows at byte " + std::to_string(extent.offset) +
                                       " are damaged: start over with " + option_text("restart"));
}

}  // namespace

RowFile::RowFile(FileSystem& files, const std::string& path, uint64_t first_byte)
    : path_(path),
      file_(files.open_write(path)),
      reader_(files.open_read(path)),
      end_(first_byte) {}

RowExtent RowFile::append(std::span<const std::byte> bytes) {
  RowExtent extent{0, bytes.size(), checksum64(bytes)};
  {
    const std::lock_guard lock(mutex_);
    extent.offset = end_;
    end_ += bytes.size();
  }
  file_->write_at(extent.offset, bytes);
  return extent;
}

RowExtent RowFile::append_rows(std::span<const int32_t> numbers) {
  std::vector<std::byte> bytes;
  encode_rows(numbers, bytes);
  return append(bytes);
}

std::vector<std::byte> RowFile::read(const RowExtent& extent) const {
  return read_extent(*reader_, extent);
}

void RowFile::read_rows(const RowExtent& extent, std::span<int32_t> out) const {
  if (!decode_rows(read(extent), out)) refuse_damage(path_, extent);
}

uint64_t RowFile::end() const {
  const std::lock_guard lock(mutex_);
  return end_;
}

std::vector<std::byte> read_extent(const ReadableFile& file, const RowExtent& extent) {
  std::vector<std::byte> bytes(extent.bytes);
  file.read_at(extent.offset, bytes);
  if (checksum64(bytes) != extent.checksum) refuse_damage(file.path(), extent);
  return bytes;
}

}  // namespace voxdag
