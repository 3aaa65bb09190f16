// A stored surface is read back unchanged, except for members that do not affect its colors.
#include "scheduler/triangles/surface_record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/geometry/fixed_triangle.h"
#include "scheduler/triangles/triangle_file.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

FixedSurface numbered_surface(int64_t position, int64_t texture, uint16_t color) {
  FixedSurface surface;
  surface.material = 70000;
  surface.is_flipped = texture < 0;
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
  EXPECT_EQ(a.is_flipped, b.is_flipped);
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
  EXPECT_EQ(sizes.front(), 41u);  // a header and nine coordinates; no color or texture
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
  bytes[0] = std::byte{32};
  EXPECT_THROW(SurfaceRecords(bytes).next(), DamagedTriangles);
}

// After a RecordStore has moved from memory to its file, it reads its records from the file, and
// its memory is free.
TEST(RecordStore, MovesToItsFile) {
  const TemporaryFolder folder;
  MemoryBudget budget(1 << 20);
  RecordStore store(system_files(), folder.file("surfaces"), budget, "surfaces");
  std::vector<ChunkList> bins(3);
  std::vector<FixedSurface> expected;
  for (int64_t i = 0; i < 9; ++i) {
    expected.push_back(numbered_surface(1, i, 60000));
    std::vector<std::byte> record;
    append_surface(expected.back(), true, record);
    store.add(bins[i % 3 == 0 ? 0 : 2], record, 1);
  }
  EXPECT_GT(budget.used(), 900u);
  EXPECT_EQ(store.file_bytes(), 0u);
  for (int times = 0; times < 2; ++times) {
    store.move_to_file(bins);
    EXPECT_EQ(budget.used(), 0u);
    std::vector<FixedSurface> found;
    for (const auto& bin : bins)
      for_each_surface(store, bin, [&](const FixedSurface& surface) { found.push_back(surface); });
    ASSERT_EQ(found.size(), 9u);
    for (size_t i = 0; i < 3; ++i) expect_equal(found[i], expected[3 * i]);
    expect_equal(found[8], expected[8]);
  }
  EXPECT_GT(store.file_bytes(), 500u);
  for (auto& bin : bins) store.clear(bin);
}

}  // namespace
}  // namespace voxdag
