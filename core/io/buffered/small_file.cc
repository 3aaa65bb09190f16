#include "core/io/buffered/small_file.h"

#include <cstring>
#include <utility>

#include "core/base/page_buffer.h"
#include "core/io/forwarding_files.h"

namespace voxdag {
namespace {

class FileInMemory : public ForwardingReader {
 public:
  FileInMemory(std::unique_ptr<ReadableFile> file, PageBuffer<std::byte> bytes)
      : ForwardingReader(std::move(file)), bytes_(std::move(bytes)) {
    ForwardingReader::read_at(0, {bytes_.data(), bytes_.size()});
  }
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    const uint64_t size = bytes_.size();
    if (offset > size || out.size() > size - offset)
      ForwardingReader::read_at(offset, out);  // throws, because the file ends earlier
    else if (!out.empty())
      std::memcpy(out.data(), bytes_.data() + offset, out.size());
  }

 private:
  PageBuffer<std::byte> bytes_;
};

}  // namespace

std::unique_ptr<ReadableFile> SmallFiles::read(std::unique_ptr<ReadableFile> file) {
  const uint64_t bytes = file->size();
  if (bytes == 0 || bytes > left_bytes_) return file;
  PageBuffer<std::byte> buffer(budget_, bytes, "a small file");
  file = std::make_unique<FileInMemory>(std::move(file), std::move(buffer));
  left_bytes_ -= bytes;
  return file;
}

}  // namespace voxdag
