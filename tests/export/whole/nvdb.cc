// Reads NanoVDB files with NanoVDB's own reader.
#include <nanovdb/util/IO.h>

#include "tests/export/whole/formats.h"

namespace voxdag::test {
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

}  // namespace

void digest_nvdb(const std::string& path, const Grid& grid, Digest& digest) {
  const auto handle = nanovdb::io::readGrid(path);
  const auto* const voxels = handle.grid<nanovdb::ValueMask>();
  expect(voxels != nullptr, "a grid of a mask");
  const auto& tree = voxels->tree();
  const auto add = [&](const nanovdb::Coord& voxel) {
    const nanovdb::Vec3d at = voxels->indexToWorld(nanovdb::Vec3d(voxel));
    digest.add(grid.cell(0, at[0], 0.5), grid.cell(1, at[1], 0.5), grid.cell(2, at[2], 0.5));
  };
  for (uint32_t i = 0; i < tree.nodeCount(0); ++i)
    for (auto voxel = tree.getFirstNode<0>()[i].beginValueOn(); voxel; ++voxel)
      add(voxel.getCoord());
  for_each_tile_voxel<1>(tree, add);
  for_each_tile_voxel<2>(tree, add);
  expect(digest.count() == voxels->activeVoxelCount(), "no tiles in the root");
}

}  // namespace voxdag::test
