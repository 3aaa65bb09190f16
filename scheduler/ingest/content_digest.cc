// The state of libcrypto's EVP digests cannot be stored; that of its older interface is plain data.
#define OPENSSL_SUPPRESS_DEPRECATED
#include "scheduler/ingest/content_digest.h"

#include <openssl/sha.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "core/base/text.h"

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

// A triangle is nine coordinates of 32 bits, which are half as much to digest; where they do not
// suffice it is the smallest 32-bit number, which never occurs as a coordinate, and nine of 64
// bits.
void ContentDigest::add(std::span<const FixedTriangle> triangles) {
  constexpr int32_t kWide = INT32_MIN;
  constexpr size_t kMaxBytes = sizeof kWide + sizeof(FixedTriangle), kAtOnce = 64;
  std::array<std::byte, kMaxBytes * kAtOnce> buffer;
  while (!triangles.empty()) {
    size_t bytes = 0;
    const auto put = [&](const void* from, size_t size) {
      std::memcpy(&buffer[bytes], from, size);
      bytes += size;
    };
    const auto portion = triangles.first(std::min(kAtOnce, triangles.size()));
    for (const FixedTriangle& triangle : portion) {
      int32_t narrow[9];
      bool fits = true;
      for (int i = 0; i < 9; ++i) {
        const int64_t coordinate = triangle.v[i / 3][i % 3];
        narrow[i] = static_cast<int32_t>(coordinate);
        fits &= narrow[i] == coordinate && narrow[i] != kWide;
      }
      if (fits) {
        put(narrow, sizeof narrow);
      } else {
        put(&kWide, sizeof kWide);
        put(&triangle, sizeof triangle);
      }
    }
    add_bytes(std::span(buffer).first(bytes));
    triangles = triangles.subspan(portion.size());
  }
}

std::string ContentDigest::hex() const {
  SHA256_CTX context;
  std::memcpy(&context, state_.data(), sizeof context);
  unsigned char digest[SHA256_DIGEST_LENGTH];
  SHA256_Final(digest, &context);
  return hex_text(digest);
}

// libcrypto takes the number of bytes that wait for a whole block for granted.
bool ContentDigest::is_sound() const {
  SHA256_CTX context;
  std::memcpy(&context, state_.data(), sizeof context);
  return context.num < SHA256_CBLOCK;
}

void ContentDigest::add_bytes(std::span<const std::byte> bytes) {
  SHA256_CTX context;
  std::memcpy(&context, state_.data(), sizeof context);
  SHA256_Update(&context, bytes.data(), bytes.size());
  std::memcpy(state_.data(), &context, sizeof context);
}

}  // namespace voxdag
