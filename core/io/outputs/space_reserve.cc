#include "core/io/outputs/space_reserve.h"

#include <algorithm>
#include <utility>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag {
namespace {

// use() reads the free space again after this many bytes were written. If little more than the
// reserve is free, use() reads the free space at every write.
constexpr uint64_t kCheckBytes = uint64_t{1} << 20;

}  // namespace

class SpaceReserve::Writer : public ForwardingWriter {
 public:
  Writer(SpaceReserve& reserve, std::unique_ptr<WritableFile> file)
      : ForwardingWriter(std::move(file)), reserve_(reserve) {}
  void write_at(uint64_t offset, std::span<const std::byte> data) override {
    reserve_.use(path(), data.size());
    ForwardingWriter::write_at(offset, data);
  }

 private:
  SpaceReserve& reserve_;
};

std::unique_ptr<WritableFile> SpaceReserve::wrap(std::unique_ptr<WritableFile> file) {
  if (reserve_bytes_ == 0) return file;
  return std::make_unique<Writer>(*this, std::move(file));
}

std::unique_ptr<WritableFile> SpaceReserve::create(const std::string& path) {
  return wrap(ForwardingFiles::create(path));
}

std::unique_ptr<WritableFile> SpaceReserve::open_write(const std::string& path) {
  return wrap(ForwardingFiles::open_write(path));
}

uint64_t SpaceReserve::free_space(const std::string& path) {
  const uint64_t bytes = ForwardingFiles::free_space(path);
  return bytes - std::min(bytes, reserve_bytes_);
}

void SpaceReserve::use(const std::string& path, uint64_t bytes) {
  if (unchecked_bytes_.fetch_add(bytes) + bytes < kCheckBytes) return;
  // Reads the free space at the path of the folder, because the file's name may already have been
  // removed.
  const uint64_t free_bytes = free_space(parent_directory(path));
  if (free_bytes < bytes)
    throw Error(ErrorCode::kNoSpace,
                "cannot write " + path + ": the disk has " + size_text(free_bytes) +
                    " free in addition to the " + size_text(reserve_bytes_) +
                    " that must stay free, expected at least " + size_text(bytes));
  unchecked_bytes_ = free_bytes < 2 * kCheckBytes ? kCheckBytes : 0;
}

}  // namespace voxdag
