// Encodes and decodes one frame: up to kFrameRows rows of one level as columns. docs/format.md,
// "Frame", documents the byte layout.
//
//   bricks:   column(mask byte planes)
//   nodes:    plane count, hashes, column(masks), column(children, byte plane 0), ...
//   column:   [stored size, high bit: zstd] [bytes]
//
// Hashes and the low byte plane of the children are random and are stored uncompressed. The other
// columns are compressed if that saves enough. On real sub-DAGs, zstd level 1 reduces brick masks
// to 50-60 %, child masks to 55-80 %, high child planes to almost nothing, and middle planes to
// 60-90 %. Compression and decompression together take 10-25 ns per row. A column that shrinks by
// less than a quarter is not compressed in the next frames.
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

  // Return the bytes of the frame, valid until the next call.
  std::span<const std::byte> encode_bricks(std::span<const uint64_t> masks);
  std::span<const std::byte> encode_nodes(const NodeLevelView& rows);

 private:
  // Columns that may be compressed: brick masks, child masks, child planes 1 to 3.
  static constexpr size_t kColumns = 5;
  struct Context;

  void put_column(size_t column, std::span<const std::byte> bytes);

  std::unique_ptr<Context> context_;
  std::array<uint32_t, kColumns> frames_to_skip_{};
  std::vector<std::byte> planes_;
  std::vector<std::byte> out_;
};

// Decodes `bytes`, which may be in `out.stored`, and computes the hashes of the bricks, truncated
// to `hash_bits`. Returns an error message, or nullptr if there is no error.
const char* decode_brick_frame(std::span<const std::byte> bytes, uint32_t rows, uint32_t hash_bits,
                               Frame& out);
// Decodes `bytes`, which may be in `out.stored`. Returns an error message, or nullptr if there is
// no error.
const char* decode_node_frame(std::span<const std::byte> bytes, uint32_t rows, uint32_t children,
                              Frame& out);

}  // namespace voxdag
