// Voxelization as in Sintorn, "DAG Construction" (2018). The voxels of all triangles are listed as
// Morton codes within the subvolume. The list is sorted and packed into bricks. tiles.h makes the
// same bricks faster.
//
// The list has a fixed capacity and is packed whenever it is full, so that the memory needed
// depends on the bricks, not on the triangles.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/backend/parallel/space/brick_list.h"
#include "core/backend/parallel/voxelize/pairs.h"

namespace voxdag::parallel {

// Splits the code of a voxel into the code of its brick and the bit of the voxel in the brick.
struct SplitVoxelCode {
  uint64_t* codes;  // codes of voxels, replaced by the codes of their bricks
  uint64_t* bits;
  VOXDAG_HD void operator()(uint32_t i) const {
    bits[i] = uint64_t{1} << (codes[i] & 63);
    codes[i] >>= 6;
  }
};

template <class Space>
class VoxelList {
 public:
  VoxelList(Space& space, BrickList<Space>& bricks, int code_bits, uint32_t capacity)
      : space_(space),
        bricks_(bricks),
        code_bits_(code_bits),
        capacity_(capacity),
        codes_(space, capacity),
        scratch_(space, capacity),
        bits_(space, capacity),
        packed_(space, capacity) {}
  static constexpr uint64_t kBytesPerVoxel = 4 * sizeof(uint64_t);

  PairSpan span() { return {codes_.data() + size_, nullptr, capacity_ - size_}; }
  void commit(uint32_t count) { size_ += count; }

  // Sorts the voxels and packs them into bricks.
  void flush() {
    if (size_ == 0) return;
    space_.sort_keys(codes_, scratch_, size_, {.begin = 0, .end = code_bits_});
    space_.for_each(size_, SplitVoxelCode{codes_.data(), bits_.data()});
    const uint32_t packed =
        space_.merge_runs(codes_.data(), bits_.data(), size_, scratch_.data(), packed_.data());
    const uint32_t at = bricks_.reserve(packed);
    space_.copy(scratch_.data(), bricks_.codes() + at, packed);
    space_.copy(packed_.data(), bricks_.masks() + at, packed);
    bricks_.commit(packed, at == 0);
    size_ = 0;
  }

 private:
  Space& space_;
  BrickList<Space>& bricks_;
  const int code_bits_;
  const uint32_t capacity_;
  uint32_t size_ = 0;
  SpaceArray<Space, uint64_t> codes_, scratch_, bits_, packed_;
};

// Returns the number of items of `bytes_each` bytes that fit in 1/share of the available memory,
// but at least `min_count` and at most 64 * Space::kWindow.
template <class Space>
uint32_t fitting_count(Space& space, uint64_t share, uint64_t bytes_each, uint64_t min_count) {
  return static_cast<uint32_t>(
      std::clamp(space.available() / share / bytes_each, min_count, 64 * Space::kWindow));
}

// Copies up to `max_count` of the next triangles to `out`, which is in the memory of the space.
// Returns their number, 0 at the end of the stream. The triangles pass through a staging area on
// the host. A GPU has two staging areas, so that one is filled while the other is copied. In a
// HostSpace, the staging area is the destination itself.
template <class Space>
uint32_t upload_triangles(Space& space, TriangleStream& stream, FixedTriangle* out,
                          uint32_t max_count) {
  uint32_t count = 0;
  while (count < max_count) {
    const std::span<FixedTriangle> area = space.staging(out + count, max_count - count);
    const size_t got = stream.read(area);
    if (got == 0) break;
    space.upload_staged(area.first(got), out + count);
    count += static_cast<uint32_t>(got);
  }
  return count;
}

// Fills `bricks` with all bricks that the triangles touch. Reads the triangles in batches.
template <class Space>
void voxelize_by_list(Space& space, const SubvolumeTask& task, TriangleStream& stream,
                      BrickList<Space>& bricks) {
  const int cube_levels = static_cast<int>(task.grid_levels - task.cube.level);
  const uint64_t frames = static_cast<uint64_t>(cube_levels) - kBrickLevels + 1;
  const uint32_t window =
      std::min<uint32_t>(fitting_count(space, 6, frames * PairExpansion<Space>::kBytesPerPair, 256),
                         static_cast<uint32_t>(Space::kWindow));
  const uint32_t voxels = fitting_count(space, 6, VoxelList<Space>::kBytesPerVoxel, 4096);
  const uint32_t batch = std::min(window, fitting_count(space, 16, sizeof(FixedTriangle), 256));
  PairExpansion<Space> pairs(space, task, cube_levels - kBrickLevels, true, window);
  VoxelList<Space> list(space, bricks, 3 * cube_levels, voxels);
  SpaceArray<Space, FixedTriangle> triangles(space, batch);
  stream.rewind();
  while (const uint32_t count = upload_triangles(space, stream, triangles.data(), batch))
    pairs.run(triangles.data(), 0, count, list);
  list.flush();
}

}  // namespace voxdag::parallel
