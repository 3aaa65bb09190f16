// Encodes and decodes one frame: up to kFrameRows rows of one level as columns. docs/format.md,
// "Frame", documents the byte layout.
//
//   bricks:   column(mask byte planes)
//   nodes:    number of byte planes of the children (1 to 4), hashes, column(masks),
//             column(children, byte plane 0), ...
//   column:   [stored size; its high bit is set if zstd was used] [bytes]
//
// Byte plane i of a column has byte i of each of its values; plane 0 is the lowest. Hashes and byte
// plane 0 of the children are random, so they are stored uncompressed. The other columns are
// compressed if that saves enough. If a column shrinks by less than a quarter, it is not compressed
// in the next 15 frames.
//
// On real sub-DAGs, level 1 of zstd reduces brick masks to 50-60 %, child masks to 55-80 %, the
// highest child planes to almost nothing, and the middle planes to 60-90 %. The encoder uses level
// -1, which compresses less but is faster. Compression and decompression together take 10-25 ns per
// row.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/dag/level_array.h"
#include "core/format/artifact/artifact.h"

namespace voxdag {

class FrameEncoder {
 public:
  FrameEncoder();
  ~FrameEncoder();

  // Encode the rows of one frame. The returned bytes are valid until the next call.
  std::span<const std::byte> encode_bricks(std::span<const uint64_t> masks);
  std::span<const std::byte> encode_nodes(const NodeLevelView& rows);

 private:
  // Columns that may be compressed: brick masks, child masks, and byte planes 1 to 3 of children.
  static constexpr size_t kColumns = 5;
  struct Context;

  void put_column(size_t column, std::span<const std::byte> bytes);

  std::unique_ptr<Context> context_;
  std::array<uint32_t, kColumns> frames_to_skip_{};
  std::vector<std::byte> planes_;
  std::vector<std::byte> out_;
};

// Decodes a frame of `rows` bricks, and computes their hashes, truncated to `hash_bits`. `bytes`
// may be the bytes of `out.stored`. Returns an error message, or nullptr if there is no error.
const char* decode_brick_frame(std::span<const std::byte> bytes, uint32_t rows, uint32_t hash_bits,
                               Frame& out);
// Decodes a frame of `rows` nodes with `children` children in total. `bytes` may be the bytes of
// `out.stored`. Returns an error message, or nullptr if there is no error.
const char* decode_node_frame(std::span<const std::byte> bytes, uint32_t rows, uint32_t children,
                              Frame& out);

}  // namespace voxdag
