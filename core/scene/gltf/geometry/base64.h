// Base64 (RFC 4648, section 4), decoded by groups of four characters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace voxdag::gltf {

// Bytes that `character_count` characters stand for, the last of which are `tail` (up to two, for
// the padding); padding may be left out.
uint64_t base64_bytes(uint64_t character_count, std::span<const std::byte> tail);

// Decodes whole or final groups; `out` has room for three bytes per group of four characters.
// Returns false for a character outside the alphabet.
bool decode_base64(std::span<const std::byte> characters, std::byte* out);

}  // namespace voxdag::gltf
