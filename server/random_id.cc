#include "server/random_id.h"

#include <sys/random.h>

#include <array>
#include <bit>
#include <cstdint>
#include <random>

#include "core/base/text.h"

namespace voxdag::server {

std::string random_id() {
  uint64_t bits = 0;
  if (getrandom(&bits, sizeof bits, 0) != sizeof bits) {
    std::random_device device;
    bits = (uint64_t{device()} << 32) | device();
  }
  return hex_text(std::bit_cast<std::array<unsigned char, sizeof bits>>(bits));
}

}  // namespace voxdag::server
