// Blocks of color pages in a package (docs/format.md, "Blocks of color pages").
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace voxdag::query {

// A color page (query/tiles/color_page.h), and the Morton code of its position.
struct CodedPage {
  uint64_t code = 0;
  std::vector<uint32_t> words;
};

// Returns the bytes of a block, not compressed. The pages are in the order of their codes.
std::string encode_color_block(const std::vector<CodedPage>& pages);
// Throws Error{kCorrupt} for bytes that encode_color_block() cannot have written.
std::vector<CodedPage> decode_color_block(std::string_view bytes);

}  // namespace voxdag::query
