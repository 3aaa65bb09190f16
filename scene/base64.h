// Decodes Base64 (RFC 4648, section 4) in groups of four characters.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace voxdag {

// Returns the number of bytes that `character_count` base64 characters encode. The characters may
// end with padding ("=") or without it. `tail` holds the last two characters, or all if there are
// fewer. Only these can be padding.
uint64_t base64_bytes(uint64_t character_count, std::span<const std::byte> tail);

// Decodes fewer than 2^31 characters. The last group may have fewer than four characters if the
// padding is absent. `out` has space for three bytes per group, including an incomplete group.
// Returns false if the characters are not base64.
bool decode_base64(std::span<const std::byte> characters, std::byte* out);

}  // namespace voxdag
