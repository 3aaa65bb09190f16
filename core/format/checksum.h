// Checksums and digests:
//
//   - XXH64 detects damage in files. It is simple enough for the standalone reader
//     (voxdag_reader.h) to have its own implementation.
//   - XXH3 with 128 bits tells whether large contents are equal.
//   - SHA-256 identifies contents, and cannot be forged.
//   - indexed_checksum() can be computed in parts, in any order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/base/progress.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Returns the XXH64 of bytes, with seed 0.
uint64_t checksum64(std::span<const std::byte> bytes);

// XXH3 with 128 bits, which is several times as fast as SHA-256. Different contents practically
// always have different checksums, but it is possible to forge contents that have a given checksum.
struct Checksum128 {
  uint64_t low = 0, high = 0;
  bool operator==(const Checksum128&) const = default;
};
Checksum128 checksum128(std::span<const std::byte> bytes);

// Computes XXH64 over bytes that are added in parts.
class Checksum64 {
 public:
  Checksum64();
  Checksum64(Checksum64&&) noexcept;
  Checksum64& operator=(Checksum64&&) noexcept;
  ~Checksum64();
  void add(std::span<const std::byte> bytes);
  // Returns the checksum of all bytes added so far.
  uint64_t value() const;
  // Forgets all bytes that were added.
  void reset();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Returns a checksum of 32-bit words that can be computed in parts, in any order and by any number
// of threads. It is a sum modulo 2^64. The sum has one term for each word, which depends on the
// word and on its index. So the checksum of all words is the sum of the parts' checksums. `first`
// is the index of words[0].
uint64_t indexed_checksum(uint64_t first, std::span<const uint32_t> words);

// Computes SHA-256 over bytes that are added in parts.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  void add(std::span<const std::byte> bytes);
  // Returns 64 lower-case hex digits. Nothing may be added afterwards.
  std::string finish();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};
// Returns the SHA-256 of a text as 64 lower-case hex digits.
std::string sha256_hex(std::string_view text);
// Returns the SHA-256 of a file, as 64 lower-case hex digits. Reads the file once from beginning to
// end. Advances `progress` by the number of bytes read.
std::string sha256_of_file(const ReadableFile& file, const CancelToken& cancel,
                           Progress* progress = nullptr);
// Returns "sha-256=:BASE64:" for a SHA-256 of 64 hex digits. This is the value of the HTTP header
// fields Content-Digest and Repr-Digest (RFC 9530).
std::string digest_field(const std::string& sha256);

}  // namespace voxdag
