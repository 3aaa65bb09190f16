// Encodes colors in blocks of 128 bits: up to 32 cells, 4 bits each. docs/format.md, "Color
// blocks", documents the layout. voxdag_reader_colors.h decodes the blocks.
//
// A block has two colors, its ends, and a weight for each cell. The weight places the cell's color
// on the line between the ends. The ends follow from the colors' principal axis and one step of
// least squares. The format has two modes, which divide the bits differently between ends and
// weights. The encoder uses the mode with the smaller squared error. All arithmetic is exact, so
// that the same colors produce the same bytes on every machine. Blocks of one or two colors are
// lossless.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/color/color_sum.h"

namespace voxdag {

inline constexpr size_t kBlockCells = 32;
inline constexpr size_t kBlockBytes = 16;

using ColorBlock = std::array<std::byte, kBlockBytes>;

// Encodes 1 to 32 colors. Their alpha is not stored. If there are fewer than 32 colors, the weights
// of the missing cells are 0.
using EncodeBlock = ColorBlock (*)(const Color* colors, size_t count);
ColorBlock encode_block_portable(const Color* colors, size_t count);
// Returns the AVX2 version, which has the same results. Returns null if this version was not built
// or if this machine cannot run it.
EncodeBlock encode_block_avx2();
EncodeBlock fastest_block_encoder();

}  // namespace voxdag
