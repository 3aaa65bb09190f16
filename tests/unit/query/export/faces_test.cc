// Tests faces_of_brick() and BrickMap against simple loops, and PlaneSort against a plain sort.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "core/geometry/morton.h"
#include "query/export/faces/brick_faces.h"
#include "query/export/faces/brick_map.h"
#include "query/export/faces/plane_sort.h"

namespace voxdag::query {
namespace {

uint64_t slow_faces(uint64_t mask, uint64_t neighbor, uint8_t axis, bool upward) {
  uint64_t faces = 0;
  for (int bit = 0; bit < 64; ++bit) {
    int at[3] = {brick_coordinate(bit, 0), brick_coordinate(bit, 1), brick_coordinate(bit, 2)};
    at[axis] += upward ? 1 : -1;
    const bool inside = at[axis] >= 0 && at[axis] < kBrickEdge;
    at[axis] &= kBrickEdge - 1;
    const uint64_t other = (inside ? mask : neighbor) >> brick_bit(at[0], at[1], at[2]) & 1;
    if ((mask >> bit & 1) && !other) faces |= uint64_t{1} << bit;
  }
  return faces;
}

TEST(Faces, OfRandomBricks) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 2000; ++i) {
    const uint64_t mask = random() & (i % 2 ? random() : ~uint64_t{0}), neighbor = random();
    for (uint8_t axis = 0; axis < 3; ++axis)
      for (const bool upward : {false, true}) {
        ASSERT_EQ(faces_of_brick(mask, neighbor, axis, upward),
                  slow_faces(mask, neighbor, axis, upward));
        const uint64_t inner = mask & ~side_cells(axis, upward);
        ASSERT_EQ(faces_of_brick(inner, neighbor, axis, upward),
                  faces_of_brick(inner, 0, axis, upward));
      }
  }
}

// The planes have many faces, few faces, or none.
TEST(Faces, AreSortedByPlane) {
  MemoryBudget budget(uint64_t{1} << 26);
  std::mt19937_64 random(2);
  for (const uint64_t extent : {uint64_t{100}, uint64_t{1} << kFaceCoordinateBits}) {
    std::vector<uint64_t> faces;
    for (const auto& [plane, count] : {std::pair{3, 1}, {4, 5000}, {6, 200}, {7, 3000}, {9, 2}})
      for (int i = 0; i < count; ++i)
        faces.push_back(
            face_of(static_cast<uint64_t>(plane), random() % extent, random() % extent));
    std::ranges::shuffle(faces, random);
    PlaneSort sort(budget, 10, "faces");
    for (const uint64_t face : faces) sort.count(face >> 2 * kFaceCoordinateBits, 1);
    sort.reserve();
    for (const uint64_t face : faces) sort.add(face >> 2 * kFaceCoordinateBits, face);
    const auto sorted = sort.sort();
    std::ranges::sort(faces);
    EXPECT_TRUE(std::ranges::equal(sorted, faces));
  }
}

// The map has one full cube. Outside the cube, it has single bricks in a grid of 8x8x8 bricks: each
// brick whose Morton code is not a multiple of 3. The mask of such a brick is its Morton code.
TEST(Faces, NeighborsInBrickMap) {
  BrickMap map;
  constexpr uint64_t kCube = 64 * 3;  // Morton code of a cube of 4x4x4 bricks
  const auto mask_of = [](uint64_t morton) -> uint64_t {
    if (morton >= kCube && morton < kCube + 64) return ~uint64_t{0};
    return morton < 512 && morton % 3 != 0 ? morton : 0;
  };
  for (uint64_t morton = 0; morton < 512; ++morton) {
    if (morton == kCube) map.add(FullCube{kCube, 16});
    if (const uint64_t mask = mask_of(morton); mask != 0 && mask != ~uint64_t{0})
      map.add(BrickMask{morton, mask});
  }
  for (size_t i = 0; i < map.bricks().size(); ++i)
    for (uint8_t axis = 0; axis < 3; ++axis)
      for (const bool upward : {false, true}) {
        uint32_t at[3];
        const uint64_t morton = map.bricks()[i].morton;
        morton_decode(morton, at[0], at[1], at[2]);
        at[axis] += upward ? 1 : -1u;
        const uint64_t expected =
            at[axis] < 8 ? mask_of(morton_encode(at[0], at[1], at[2])) : uint64_t{0};
        ASSERT_EQ(map.mask_at(BrickMap::next_morton(morton, axis, upward), i, upward), expected);
        ASSERT_EQ(map.mask_at(BrickMap::next_morton(morton, axis, upward),
                              upward ? 0 : map.bricks().size(), upward),
                  expected);
      }
}

}  // namespace
}  // namespace voxdag::query
