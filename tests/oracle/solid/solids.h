// Meshes with an inside, for the rules of crossings and solids: closed, open, nested, inverted,
// doubled, touching and random ones, and meshes with edges through voxel corners and centers.
#pragma once

#include <string>

#include "tests/oracle/triangle.h"

namespace oracle {

enum class SolidKind {
  // Closed: every directed edge occurs as often as its reverse.
  kBox,  // a box along the axes
  kSphere,
  kTorus,
  kTetrahedra,    // random overlapping tetrahedra
  kNested,        // a sphere in a sphere, the inner one inverted
  kNestedAlike,   // a sphere in a sphere, both facing outward
  kInverted,      // a sphere turned inside out
  kDoubled,       // every face twice
  kCanceled,      // every face and its mirror image
  kTouching,      // two boxes that share a face
  kTies,          // tetrahedra with edges through corners and centers of voxels
  kHalfInverted,  // overlapping tetrahedra, half of them inverted
  // Open.
  kOpenBox,     // a box without its lid
  kHoles,       // a sphere from which triangles are missing
  kPlane,       // a slanted plane through the region
  kThreeWalls,  // three walls that meet in a corner
  kSoup,        // random triangles
  kWithRest,    // a torus, and degenerate triangles
  kCrossing,    // spheres that leave the region
};
constexpr SolidKind kClosedSolids[] = {
    SolidKind::kBox,      SolidKind::kSphere,   SolidKind::kTorus,    SolidKind::kTetrahedra,
    SolidKind::kNested,   SolidKind::kInverted, SolidKind::kDoubled,  SolidKind::kNestedAlike,
    SolidKind::kTouching, SolidKind::kTies,     SolidKind::kCanceled, SolidKind::kHalfInverted};
constexpr SolidKind kOpenSolids[] = {
    SolidKind::kOpenBox, SolidKind::kHoles,    SolidKind::kPlane,   SolidKind::kThreeWalls,
    SolidKind::kSoup,    SolidKind::kWithRest, SolidKind::kCrossing};

// Returns the name of a kind: "box", "one_inverted", ...
std::string kind_name(SolidKind kind);

// Returns a mesh in the grid [0, edge]^3 of voxels. The same seed gives the same triangles.
Triangles make_solid(SolidKind kind, uint64_t seed, int edge);

}  // namespace oracle
