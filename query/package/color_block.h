// Encodes and decodes the blocks of color pages of a package (docs/format.md, "Blocks of color
// pages").
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace voxdag::query {

// The words of a color page (query/tiles/color_page.h), and the Morton code of the page's position.
// The unit of the position is the edge of a page.
struct CodedPage {
  uint64_t code = 0;
  std::vector<uint32_t> words;
};

// Returns the uncompressed bytes of a block with these pages. The pages must be in increasing order
// of their codes.
std::string encode_color_block(const std::vector<CodedPage>& pages);
// Returns the pages of a block. Throws Error{kCorrupt} for bytes that encode_color_block() cannot
// have returned.
std::vector<CodedPage> decode_color_block(std::string_view bytes);

}  // namespace voxdag::query
