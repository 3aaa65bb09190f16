// Decodes images. Any input gives either pixels or an error, and the same result again at the
// second try. The input is also decoded with corrected PNG checksums, so that a mutation reaches
// the code after the checksum tests.
#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/image/image_reader.h"
#include "tests/fuzz/support/fuzz_target.h"

namespace voxdag {
namespace {

constexpr uint64_t kMemoryBytes = uint64_t{32} << 20;
// Only the first rows of a large image are decoded.
constexpr uint64_t kMaxPixels = uint64_t{1} << 20;

class BytesSource : public EncodedBytes {
 public:
  explicit BytesSource(std::span<const std::byte> bytes) : bytes_(bytes) {}
  size_t read(std::span<std::byte> out) override {
    const size_t size = std::min(out.size(), bytes_.size());
    std::copy_n(bytes_.begin(), size, out.begin());
    bytes_ = bytes_.subspan(size);
    return size;
  }

 private:
  std::span<const std::byte> bytes_;
};

// Returns a checksum of the pixels, or the error.
std::string decode(std::span<const std::byte> bytes) {
  MemoryBudget budget(kMemoryBytes);
  std::string result;
  try {
    BytesSource source(bytes);
    const auto reader = open_image(source, budget);
    std::vector<std::byte> row(size_t{reader->width()} * (reader->bits() == 16 ? 8 : 4));
    uint64_t checksum = reader->width();
    for (uint64_t y = 0; y < reader->height() && y * reader->width() < kMaxPixels; ++y) {
      reader->read_row(row);
      checksum = checksum64(row) ^ (checksum * 31);
    }
    result = std::to_string(checksum);
  } catch (const BrokenImage& broken) {
    fuzz::require(!broken.message.empty(), "a broken image has a message");
    result = broken.message;
  } catch (const Error& error) {
    fuzz::require(error.code() == ErrorCode::kOutOfMemory, "no error but that of memory");
    result = error.message();
  }
  fuzz::require(budget.used() == 0, "no memory stays charged");
  return result;
}

std::vector<std::byte> with_fitting_checksums(std::span<const std::byte> input) {
  std::vector<std::byte> png(input.begin(), input.end());
  const auto number = [&](size_t at) {
    uint32_t value = 0;
    for (size_t i = 0; i < 4; ++i) value = value << 8 | std::to_integer<uint32_t>(png[at + i]);
    return value;
  };
  for (size_t at = 8; at + 12 <= png.size();) {
    const size_t size = number(at);
    if (size > png.size() - at - 12) break;
    const uLong sum =
        crc32(0, reinterpret_cast<const Bytef*>(&png[at + 4]), static_cast<uInt>(size + 4));
    for (size_t i = 0; i < 4; ++i)
      png[at + 8 + size + i] = static_cast<std::byte>(sum >> (24 - 8 * i));
    at += 12 + size;
  }
  return png;
}

}  // namespace
}  // namespace voxdag

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  const auto bytes = fuzz::bytes_of(data, size);
  fuzz::require(decode(bytes) == decode(bytes), "the same bytes are the same pixels");
  decode(with_fitting_checksums(bytes));
  return 0;
}
