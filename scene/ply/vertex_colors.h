// The colors of the vertices of a PLY file, within a fixed amount of memory. Blocks of consecutive
// vertices are cached; block b can only be in slot b modulo the number of slots. Not thread-safe.
//
// Red, green and blue are sRGB and become linear light; alpha is linear. Floats and doubles are
// from 0 to 1, ushort numbers from 0 to 65535 and all other integers from 0 to 255. Values outside
// these ranges are clamped.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/page_buffer.h"
#include "scene/ply/vertex_reader.h"

namespace voxdag::ply {

class VertexColors {
 public:
  using Color = std::array<uint16_t, 4>;

  // The caches of all readers of a scene together take at most 1/kShareOfFree of the free bytes of
  // the memory budget.
  static constexpr uint64_t kShareOfFree = 8;

  // The file must have colors. The file and the budget must outlive this object.
  VertexColors(const PlyFile& ply, unsigned readers, MemoryBudget& budget);

  // Returns the color in the units of SurfaceCorner, valid until the next call. The vertex must
  // exist.
  const Color& at(uint32_t vertex) {
    const uint64_t block = vertex / kBlockVertices;
    const size_t slot = static_cast<size_t>(block) & slot_mask_;
    if (block_in_slot_[slot] != block) load(block, slot);
    return colors_[slot * kBlockVertices + vertex % kBlockVertices];
  }

 private:
  static constexpr uint64_t kBlockVertices = 1024;
  static constexpr uint64_t kNoBlock = ~uint64_t{0};

  void load(uint64_t block, size_t slot);

  VertexReader reader_;
  std::vector<double> full_;  // maximum value of each channel
  std::array<uint16_t, 256> light_of_byte_;
  std::vector<double> numbers_;
  PageBuffer<Color> colors_;
  std::vector<uint64_t> block_in_slot_;
  size_t slot_mask_ = 0;
};

}  // namespace voxdag::ply
