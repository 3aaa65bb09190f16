#include "core/image/readers.h"

namespace voxdag {

WholeFile::WholeFile(PeekedSource& source, MemoryBudget& budget) {
  constexpr size_t kFirstSize = 64 << 10;
  constexpr const char* kPurpose = "an encoded image";
  bytes_ = PageBuffer<uint8_t>(budget, kFirstSize, kPurpose);
  for (;;) {
    const size_t wanted = bytes_.size() - size_;
    const size_t read = source.read(reinterpret_cast<std::byte*>(&bytes_[size_]), wanted);
    source.rethrow();
    size_ += read;
    if (read < wanted) return;
    bytes_.grow(2 * bytes_.size(), kPurpose);
  }
}

}  // namespace voxdag
