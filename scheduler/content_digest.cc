// libcrypto's EVP digests do not give out their state; its older interface is plain data.
#define OPENSSL_SUPPRESS_DEPRECATED
#include "scheduler/content_digest.h"

#include <openssl/sha.h>

#include <cstring>
#include <type_traits>

namespace voxdag {

ContentDigest::ContentDigest(const Grid& grid) {
  static_assert(sizeof(SHA256_CTX) == sizeof state_ && std::is_trivially_copyable_v<SHA256_CTX>);
  SHA256_CTX context;
  SHA256_Init(&context);
  std::memcpy(state_.data(), &context, sizeof context);
  const double numbers[] = {static_cast<double>(grid.resolution()), grid.origin[0], grid.origin[1],
                            grid.origin[2], grid.edge};
  add_bytes(std::as_bytes(std::span(numbers)));
}

void ContentDigest::add(std::span<const FixedTriangle> triangles) {
  add_bytes(std::as_bytes(triangles));
}

std::string ContentDigest::hex() const {
  SHA256_CTX context;
  std::memcpy(&context, state_.data(), sizeof context);
  unsigned char digest[SHA256_DIGEST_LENGTH];
  SHA256_Final(digest, &context);
  std::string hex;
  for (const unsigned char byte : digest) {
    hex += "0123456789abcdef"[byte >> 4];
    hex += "0123456789abcdef"[byte & 15];
  }
  return hex;
}

void ContentDigest::add_bytes(std::span<const std::byte> bytes) {
  SHA256_CTX context;
  std::memcpy(&context, state_.data(), sizeof context);
  SHA256_Update(&context, bytes.data(), bytes.size());
  std::memcpy(state_.data(), &context, sizeof context);
}

}  // namespace voxdag
