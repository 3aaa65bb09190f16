// Reads NanoVDB files with NanoVDB's own reader.
#include <nanovdb/util/IO.h>

#include "tests/export/whole/formats.h"

namespace voxdag::test {

void digest_nvdb(const std::string& path, const Grid& grid, Digest& digest) {
  const auto handle = nanovdb::io::readGrid(path);
  const auto* const voxels = handle.grid<nanovdb::ValueMask>();
  expect(voxels != nullptr, "a grid of a mask");
  const auto& tree = voxels->tree();
  for (uint32_t i = 0; i < tree.nodeCount(0); ++i)
    for (auto voxel = tree.getFirstNode<0>()[i].beginValueOn(); voxel; ++voxel) {
      const nanovdb::Vec3d at = voxels->indexToWorld(nanovdb::Vec3d(voxel.getCoord()));
      digest.add(grid.cell(0, at[0], 0.5), grid.cell(1, at[1], 0.5), grid.cell(2, at[2], 0.5));
    }
  // The count differs if the tree has tiles, which stand for more voxels than the leaves have.
  expect(digest.count() == voxels->activeVoxelCount(), "all voxels in leaves");
}

}  // namespace voxdag::test
