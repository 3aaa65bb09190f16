// The connected components of the voxels of one cube of the octree, in coordinates relative to the
// cube's low corner.
//
// A component is *open* if it has a voxel at a face of the cube: voxels outside of the cube can be
// connected to it. All other components are *closed*: they are counted, and only the largest ones
// are kept. So the memory for a cube depends on its faces, not on its volume.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace voxdag::query {

// Voxels are connected if they have a common face (6 neighbors), or a common face, edge or corner
// (26 neighbors).
enum class Connectivity { kFaces, kCorners };

struct Component {
  uint64_t voxels = 0;
  // The smallest box with all voxels: the low corner, which is in the box, and the high corner,
  // which is not.
  std::array<uint32_t, 3> low{~0u, ~0u, ~0u}, high{};
  friend bool operator==(const Component&, const Component&) = default;
};

// Consecutive voxels in a row of a face of a cube. The coordinates of a face with the normal x are
// u = y and v = z; with the normal y, u = x and v = z; with the normal z, u = x and v = y.
struct FaceRun {
  uint32_t u = 0;
  uint32_t begin = 0, end = 0;  // the voxels with begin <= v < end
  uint32_t label = 0;           // index of the component in CubeComponents::open
};

struct CubeComponents {
  // The voxels at the faces of the cube, sorted by u, then by v. The index is 2 * axis for the low
  // face and 2 * axis + 1 for the high face.
  std::array<std::vector<FaceRun>, 6> faces;
  std::vector<Component> open;
  uint64_t closed = 0;             // number of closed components
  std::vector<Component> largest;  // the largest closed components, the largest first

  uint64_t bytes() const;
};

struct ComponentRule {
  Connectivity connectivity = Connectivity::kCorners;
  size_t largest = 10;  // maximum length of CubeComponents::largest
};

// Returns the components of a brick.
CubeComponents components_of_brick(uint64_t mask, const ComponentRule& rule);

// Returns the components of a cube of 2 * edge voxels per edge from the components of its children;
// null for a child without voxels. Throws Error{kLimit} for 2^32 open components or more.
CubeComponents join_components(std::span<const CubeComponents* const, 8> children, uint32_t edge,
                               const ComponentRule& rule);

// Makes all open components closed, because the cube is the complete grid.
void close_all(CubeComponents& cube, const ComponentRule& rule);

}  // namespace voxdag::query
