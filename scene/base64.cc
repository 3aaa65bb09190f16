#include "scene/base64.h"

#include <openssl/evp.h>

#include <algorithm>
#include <array>

namespace voxdag {
namespace {

// Decodes groups of four characters to `out`. Returns false for invalid characters, also for spaces
// at the beginning or the end. libcrypto skips such spaces but then decodes fewer bytes, which the
// comparison in the last line detects.
bool decode_groups(std::span<const std::byte> characters, std::byte* out) {
  const int bytes = EVP_DecodeBlock(reinterpret_cast<unsigned char*>(out),
                                    reinterpret_cast<const unsigned char*>(characters.data()),
                                    static_cast<int>(characters.size()));
  return bytes == static_cast<int>(characters.size() / 4 * 3);
}

}  // namespace

uint64_t base64_bytes(uint64_t character_count, std::span<const std::byte> tail) {
  for (size_t i = tail.size(); i-- > 0 && tail[i] == std::byte{'='};) --character_count;
  return character_count / 4 * 3 + character_count % 4 * 3 / 4;
}

bool decode_base64(std::span<const std::byte> characters, std::byte* out) {
  const size_t complete = characters.size() / 4 * 4;
  if (complete > 0 && !decode_groups(characters.first(complete), out)) return false;
  if (complete == characters.size()) return true;
  std::array<std::byte, 4> last;
  last.fill(std::byte{'='});
  std::ranges::copy(characters.subspan(complete), last.begin());
  return decode_groups(last, out + complete / 4 * 3);
}

}  // namespace voxdag
