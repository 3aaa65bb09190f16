#include "scene/gltf/mesh_data/base64.h"

#include <array>
#include <string_view>

namespace voxdag::gltf {
namespace {

constexpr std::string_view kAlphabet =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr uint8_t kNone = 255;

constexpr std::array<uint8_t, 256> kValues = [] {
  std::array<uint8_t, 256> values{};
  values.fill(kNone);
  for (size_t i = 0; i < kAlphabet.size(); ++i)
    values[static_cast<unsigned char>(kAlphabet[i])] = static_cast<uint8_t>(i);
  return values;
}();

}  // namespace

uint64_t base64_bytes(uint64_t character_count, std::span<const std::byte> tail) {
  for (size_t i = tail.size(); i-- > 0 && tail[i] == std::byte{'='};) --character_count;
  return character_count / 4 * 3 + character_count % 4 * 3 / 4;
}

bool decode_base64(std::span<const std::byte> characters, std::byte* out) {
  for (size_t i = 0; i < characters.size(); i += 4) {
    uint32_t group = 0;
    for (size_t k = 0; k < 4; ++k) {
      const bool given = i + k < characters.size() && characters[i + k] != std::byte{'='};
      const uint8_t value = given ? kValues[std::to_integer<size_t>(characters[i + k])] : 0;
      if (value == kNone) return false;
      group = group << 6 | value;
    }
    for (int shift : {16, 8, 0}) *out++ = static_cast<std::byte>(group >> shift & 0xff);
  }
  return true;
}

}  // namespace voxdag::gltf
