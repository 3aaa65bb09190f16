// nanovdb_voxels FILE.nvdb: writes the world coordinates of all voxels that are on in the file's
// grid as doubles, as NanoVDB's own reader finds them.
#include <nanovdb/util/IO.h>

#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const auto handle = nanovdb::io::readGrid(argv[1]);
  const auto* const grid = handle.grid<nanovdb::ValueMask>();
  if (!grid) return 1;
  const auto& tree = grid->tree();
  uint64_t count = 0;
  for (uint32_t i = 0; i < tree.nodeCount(0); ++i) {
    const auto& leaf = tree.getFirstNode<0>()[i];
    for (auto voxel = leaf.beginValueOn(); voxel; ++voxel, ++count) {
      const nanovdb::Vec3d at = grid->indexToWorld(nanovdb::Vec3d(voxel.getCoord()));
      const double numbers[] = {at[0], at[1], at[2]};
      std::fwrite(numbers, sizeof(numbers), 1, stdout);
    }
  }
  // Tiles would stand for more voxels than the leaves have.
  if (count != grid->activeVoxelCount()) return 1;
  return std::fflush(stdout) == 0 ? 0 : 1;
}
