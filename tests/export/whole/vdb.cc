// Reads OpenVDB files with OpenVDB's own library.
#include <openvdb/openvdb.h>

#include "tests/export/whole/formats.h"

namespace voxdag::test {

void digest_vdb(const std::string& path, const Grid& grid, Digest& digest) {
  openvdb::initialize();
  openvdb::io::File file(path);
  file.open();
  const auto voxels = openvdb::gridPtrCast<openvdb::BoolGrid>(file.readGrid("voxels"));
  expect(voxels && !voxels->background(), "a grid of booleans");
  for (auto value = voxels->cbeginValueOn(); value; ++value) {  // voxels and tiles
    expect(*value, "voxels that are true");
    const openvdb::CoordBBox box = value.getBoundingBox();
    for (openvdb::CoordBBox::ZYXIterator at(box); at; ++at) {
      const openvdb::Vec3d center = voxels->indexToWorld(*at);
      for (int axis = 0; axis < 3; ++axis)
        expect(grid.cell(axis, center[axis], 0.5) == (*at)[axis], "a center where its voxel is");
      digest.add((*at)[0], (*at)[1], (*at)[2]);
    }
  }
}

}  // namespace voxdag::test
