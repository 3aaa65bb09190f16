// nanovdb_voxels FILE.nvdb [GRID]: writes, as doubles, the world coordinates of all voxels that are
// on in the file's first grid. With GRID, writes the voxels of the grid of this name, each followed
// by its three values. The program reads the file with NanoVDB's own reader.
#include <nanovdb/util/IO.h>

#include <cstdio>

namespace {

template <class Value, class Write>
bool list(const nanovdb::NanoGrid<Value>* grid, const Write& write) {
  if (!grid) return false;
  const auto& tree = grid->tree();
  uint64_t count = 0;
  for (uint32_t i = 0; i < tree.nodeCount(0); ++i) {
    const auto& leaf = tree.template getFirstNode<0>()[i];
    for (auto voxel = leaf.beginValueOn(); voxel; ++voxel, ++count) {
      const nanovdb::Vec3d at = grid->indexToWorld(nanovdb::Vec3d(voxel.getCoord()));
      const double numbers[] = {at[0], at[1], at[2]};
      std::fwrite(numbers, sizeof(numbers), 1, stdout);
      write(leaf.getValue(voxel.getCoord()));
    }
  }
  // The count differs if the tree has tiles, which stand for more voxels than the leaves have.
  return count == grid->activeVoxelCount();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 && argc != 3) return 2;
  const auto handle = argc == 3 ? nanovdb::io::readGrid(argv[1], std::string(argv[2]))
                                : nanovdb::io::readGrid(argv[1]);
  const bool done = argc == 3 ? list(handle.grid<nanovdb::Vec3f>(),
                                     [](const nanovdb::Vec3f& value) {
                                       for (int i = 0; i < 3; ++i) {
                                         const double part = value[i];
                                         std::fwrite(&part, sizeof(part), 1, stdout);
                                       }
                                     })
                              : list(handle.grid<nanovdb::ValueMask>(), [](bool) {});
  return done && std::fflush(stdout) == 0 ? 0 : 1;
}
