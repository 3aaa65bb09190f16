// The tutorial's voxelization: triangles to a list of voxels, as Morton codes within the subvolume,
// sorted and packed into bricks. The plain reference; tiles.h is the fast way to the same bricks.
//
// Voxels are listed up to a fixed number, then packed and forgotten, so that memory follows the
// bricks and not the triangles.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/backend/parallel/voxelize/brick_list.h"
#include "core/backend/parallel/voxelize/pairs.h"
#include "core/backend/parallel/voxelize/triangle_upload.h"

namespace voxdag::parallel {

// A voxel as (code of its brick, its bit).
struct SplitVoxelCode {
  uint64_t* codes;  // voxel in, brick out
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
  void took(uint32_t count) { size_ += count; }

  // Sorts the voxels and packs them into bricks.
  void flush() {
    if (size_ == 0) return;
    space_.sort_keys(codes_, scratch_, size_, 0, code_bits_);
    space_.for_each(size_, SplitVoxelCode{codes_.data(), bits_.data()});
    const uint32_t packed =
        space_.merge_runs(codes_.data(), bits_.data(), size_, scratch_.data(), packed_.data());
    const uint32_t at = bricks_.make_room(packed);
    space_.copy(scratch_.data(), bricks_.codes() + at, packed);
    space_.copy(packed_.data(), bricks_.masks() + at, packed);
    bricks_.took(packed, at == 0);
    size_ = 0;
  }

 private:
  Space& space_;
  BrickList<Space>& bricks_;
  const int code_bits_;
  const uint32_t capacity_;
  uint32_t size_ = 0;
  Buffer<Space, uint64_t> codes_, scratch_, bits_, packed_;
};

// How many items of `bytes_each` fit a share of the memory that is left, between `least` and what
// the space likes to work on at once.
template <class Space>
uint32_t items_that_fit(Space& space, uint64_t share, uint64_t bytes_each, uint64_t least) {
  return static_cast<uint32_t>(
      std::clamp(space.available() / share / bytes_each, least, 64 * Space::kWindow));
}

// Fills `bricks` with all that the triangles touch, in batches.
template <class Space>
void voxelize_by_list(Space& space, const SubvolumeTask& task, TriangleStream& stream,
                      BrickList<Space>& bricks) {
  const int cube_levels = static_cast<int>(task.grid_levels - task.cube.level);
  const uint64_t frames = static_cast<uint64_t>(cube_levels) - kBrickLevels + 1;
  const uint32_t window = std::min<uint32_t>(
      items_that_fit(space, 6, frames * PairExpansion<Space>::kBytesPerPair, 256),
      static_cast<uint32_t>(Space::kWindow));
  const uint32_t voxels = items_that_fit(space, 6, VoxelList<Space>::kBytesPerVoxel, 4096);
  const uint32_t batch = std::min(window, items_that_fit(space, 16, sizeof(FixedTriangle), 256));
  PairExpansion<Space> pairs(space, task, cube_levels - kBrickLevels, true, window);
  VoxelList<Space> list(space, bricks, 3 * cube_levels, voxels);
  Buffer<Space, FixedTriangle> triangles(space, batch);
  TriangleUpload<Space> upload(space, stream);
  while (const uint32_t count = upload.read(triangles.data(), batch))
    pairs.run(triangles.data(), 0, count, list);
  list.flush();
}

}  // namespace voxdag::parallel
