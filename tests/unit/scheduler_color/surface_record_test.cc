// Stored surfaces come back as they were, but for what their colors do not depend on.
#include "scheduler/color/surface_record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/geometry/fixed_triangle.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {
namespace {

FixedSurface numbered_surface(int64_t position, int64_t texture, uint16_t color) {
  FixedSurface surface;
  surface.material = 70000;
  for (int64_t i = 0; i < 9; ++i)
    surface.position.v[i / 3][i % 3] = position + (i % 2 ? 2 * i : -2 * i);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t a = 0; a < 2; ++a)
      surface.corners[i].texture[a] = texture + static_cast<int64_t>(2 * i + a);
    for (size_t c = 0; c < 4; ++c)
      surface.corners[i].color[c] = static_cast<uint16_t>(color - 4 * i - c);
  }
  return surface;
}

FixedSurface without_look(FixedSurface surface, bool has_texture, bool has_color) {
  for (SurfaceCorner& corner : surface.corners) {
    if (!has_texture) corner.texture = {};
    if (!has_color) corner.color = SurfaceCorner{}.color;
  }
  return surface;
}

void expect_equal(const FixedSurface& a, const FixedSurface& b) {
  EXPECT_EQ(a.material, b.material);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t k = 0; k < 3; ++k) EXPECT_EQ(a.position.v[i][k], b.position.v[i][k]);
    EXPECT_EQ(a.corners[i].texture, b.corners[i].texture);
    EXPECT_EQ(a.corners[i].color, b.corners[i].color);
  }
}

TEST(SurfaceRecord, ComesBackAsItWas) {
  std::vector<std::byte> bytes;
  std::vector<FixedSurface> expected;
  std::vector<size_t> sizes;
  for (const int64_t position : {int64_t{-1001}, kCoordinateLimit - 101, 101 - kCoordinateLimit})
    for (const int64_t texture : {int64_t{-9}, int64_t{1} << 39, -(int64_t{1} << 39)})
      for (const bool has_image : {false, true})
        for (const bool has_color : {false, true}) {
          const FixedSurface surface =
              without_look(numbered_surface(position, texture, 60000), true, has_color);
          const size_t before = bytes.size();
          append_surface(surface, has_image, bytes);
          sizes.push_back(bytes.size() - before);
          expected.push_back(without_look(surface, has_image, has_color));
        }
  EXPECT_EQ(sizes.front(), 41u);  // a header and nine coordinates: no look
  EXPECT_EQ(*std::max_element(sizes.begin(), sizes.end()), 149u);
  EXPECT_LE(149u, kMaxSurfaceRecordBytes);
  SurfaceRecords records(bytes);
  for (const FixedSurface& surface : expected) {
    const auto next = records.next();
    ASSERT_TRUE(next);
    expect_equal(*next, surface);
  }
  EXPECT_FALSE(records.next());
}

TEST(SurfaceRecord, RefusesWhatIsNoRecord) {
  std::vector<std::byte> bytes;
  append_surface(numbered_surface(1, 1, 60000), true, bytes);
  for (size_t size = 1; size < bytes.size(); ++size)
    EXPECT_THROW(SurfaceRecords(std::span(bytes).first(size)).next(), DamagedTriangles) << size;
  bytes[0] = std::byte{16};
  EXPECT_THROW(SurfaceRecords(bytes).next(), DamagedTriangles);
}

}  // namespace
}  // namespace voxdag
