// nanovdb_voxels FILE.nvdb [GRID [LOW EDGE]]: writes the world coordinates of voxels as doubles.
// Without GRID, writes all active voxels of the first grid of the file, in leaves and in tiles.
// This grid is a mask, or has floats, all of which must be 1. With GRID, writes the voxels of the
// grid with this name, each followed by its three values. With LOW and EDGE, GRID is a level set.
// Then writes its background, the world coordinates of cell (0, 0, 0), and two numbers for each
// cell of the cube of EDGE^3 cells at (LOW, LOW, LOW): its value, and 1 if it is active, otherwise
// 0. The program reads the file with NanoVDB's own reader.
#include <nanovdb/util/IO.h>

#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

// Calls add(coord) for the voxels of all active tiles of the tree's nodes at `kLevel`, 1 or 2.
template <int kLevel, class Tree, class Add>
void for_each_tile_voxel(const Tree& tree, const Add& add) {
  for (uint32_t i = 0; i < tree.nodeCount(kLevel); ++i) {
    const auto& node = tree.template getFirstNode<kLevel>()[i];
    using Node = std::decay_t<decltype(node)>;
    constexpr int kEdge = Node::ChildNodeType::DIM;
    for (uint32_t tile = 0; tile < Node::SIZE; ++tile) {
      if (!node.valueMask().isOn(tile) || node.childMask().isOn(tile)) continue;
      const nanovdb::Coord low = node.offsetToGlobalCoord(tile);
      for (int x = 0; x < kEdge; ++x)
        for (int y = 0; y < kEdge; ++y)
          for (int z = 0; z < kEdge; ++z) add(low + nanovdb::Coord(x, y, z));
    }
  }
}

template <class Value, class Write>
bool list(const nanovdb::NanoGrid<Value>* grid, const Write& write) {
  if (!grid) return false;
  const auto& tree = grid->tree();
  uint64_t count = 0;
  const auto add = [&](const nanovdb::Coord& coord) {
    const nanovdb::Vec3d at = grid->indexToWorld(nanovdb::Vec3d(coord));
    const double numbers[] = {at[0], at[1], at[2]};
    std::fwrite(numbers, sizeof(numbers), 1, stdout);
    write(tree.getValue(coord));
    ++count;
  };
  for (uint32_t i = 0; i < tree.nodeCount(0); ++i) {
    const auto& leaf = tree.template getFirstNode<0>()[i];
    for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) add(voxel.getCoord());
  }
  for_each_tile_voxel<1>(tree, add);
  for_each_tile_voxel<2>(tree, add);
  return count == grid->activeVoxelCount();
}

bool list_cube(const nanovdb::NanoGrid<float>* grid, int low, int edge) {
  if (!grid || !grid->isLevelSet()) return false;
  const auto& tree = grid->tree();
  const nanovdb::Vec3d corner = grid->indexToWorld(nanovdb::Vec3d(0, 0, 0));
  std::vector<double> numbers = {tree.background(), corner[0], corner[1], corner[2]};
  for (int x = low; x < low + edge; ++x)
    for (int y = low; y < low + edge; ++y)
      for (int z = low; z < low + edge; ++z) {
        const nanovdb::Coord cell(x, y, z);
        numbers.push_back(tree.getValue(cell));
        numbers.push_back(tree.isActive(cell) ? 1 : 0);
      }
  return std::fwrite(numbers.data(), sizeof(double), numbers.size(), stdout) == numbers.size();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 5) {
    const auto handle = nanovdb::io::readGrid(argv[1], std::string(argv[2]));
    const bool done = list_cube(handle.grid<float>(), std::atoi(argv[3]), std::atoi(argv[4]));
    return done && std::fflush(stdout) == 0 ? 0 : 1;
  }
  if (argc != 2 && argc != 3) return 2;
  const auto handle = argc == 3 ? nanovdb::io::readGrid(argv[1], std::string(argv[2]))
                                : nanovdb::io::readGrid(argv[1]);
  bool is_one = true;
  const auto* const density = argc == 3 ? nullptr : handle.grid<float>();
  if (density && !density->isFogVolume()) return 1;
  const bool done = argc == 3 ? list(handle.grid<nanovdb::Vec3f>(),
                                     [](const nanovdb::Vec3f& value) {
                                       for (int i = 0; i < 3; ++i) {
                                         const double part = value[i];
                                         std::fwrite(&part, sizeof(part), 1, stdout);
                                       }
                                     })
                    : density ? list(density, [&](float value) { is_one = is_one && value == 1; })
                              : list(handle.grid<nanovdb::ValueMask>(), [](bool) {});
  return done && is_one && std::fflush(stdout) == 0 ? 0 : 1;
}
