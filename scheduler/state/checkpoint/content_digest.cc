#include "scheduler/state/checkpoint/content_digest.h"

#include <span>

#include "core/base/text.h"

namespace voxdag {

ContentDigest::ContentDigest(const Grid& grid) {
  const double numbers[] = {static_cast<double>(grid.resolution()), grid.origin[0], grid.origin[1],
                            grid.origin[2], grid.edge};
  state_ = checksum128(std::as_bytes(std::span(numbers)));
}

void ContentDigest::add(const Checksum128& piece) {
  const Checksum128 both[] = {state_, piece};
  state_ = checksum128(std::as_bytes(std::span(both)));
}

std::string ContentDigest::hex() const {
  unsigned char bytes[sizeof state_];
  for (size_t i = 0; i < 8; ++i) {
    bytes[i] = static_cast<unsigned char>(state_.high >> (56 - 8 * i));
    bytes[8 + i] = static_cast<unsigned char>(state_.low >> (56 - 8 * i));
  }
  return hex_text(bytes);
}

}  // namespace voxdag
