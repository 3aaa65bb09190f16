#include "server/random_id.h"

#include <sys/random.h>

#include <cstdint>
#include <random>

namespace voxdag::server {

std::string random_id() {
  uint64_t bits = 0;
  if (getrandom(&bits, sizeof bits, 0) != sizeof bits) {
    std::random_device device;
    bits = (uint64_t{device()} << 32) | device();
  }
  std::string text(16, '0');
  for (char& digit : text) {
    digit = "0123456789abcdef"[bits & 15];
    bits >>= 4;
  }
  return text;
}

}  // namespace voxdag::server
