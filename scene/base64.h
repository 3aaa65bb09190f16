// Base64 (RFC 4648, section 4), decoded by groups of four characters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace voxdag {

// Returns the number of bytes that `character_count` characters encode. `tail` is the last two
// characters, or all if there are fewer; padding may be absent.
uint64_t base64_bytes(uint64_t character_count, std::span<const std::byte> tail);

// Decodes groups of four characters; the last group may be shorter. `out` has space for three bytes
// per group. At most 2^31 characters. Returns false for a character outside the alphabet.
bool decode_base64(std::span<const std::byte> characters, std::byte* out);

}  // namespace voxdag
