// Reads OpenVDB files with OpenVDB's own library.
#include <openvdb/openvdb.h>

#include "tests/export/whole/formats.h"

namespace voxdag::test {

void digest_vdb(const std::string& path, const Grid& grid, Digest& digest) {
  openvdb::initialize();
  openvdb::io::File file(path);
  file.open();
  const auto voxels = openvdb::gridPtrCast<openvdb::BoolGrid>(file.readGrid("voxels"));
  expect(voxels && !voxels->background() && voxels->tree().activeTileCount() == 0,
         "a grid of booleans, all of them in leaves");
  for (auto leaf = voxels->tree().cbeginLeaf(); leaf; ++leaf)
    for (auto voxel = leaf->cbeginValueOn(); voxel; ++voxel) {
      const openvdb::Coord at = voxel.getCoord();
      const openvdb::Vec3d center = voxels->indexToWorld(at);
      for (int axis = 0; axis < 3; ++axis)
        expect(grid.cell(axis, center[axis], 0.5) == at[axis], "a center where its voxel is");
      expect(*voxel, "voxels that are true");
      digest.add(at[0], at[1], at[2]);
    }
}

}  // namespace voxdag::test
