#include "scheduler/ingest/content_digest.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/format/checksum.h"

namespace voxdag {
namespace {

// The digest is SHA-256 over the grid's five numbers and the triangles, in whatever portions they
// come, and continues from a copy of itself.
TEST(ContentDigest, IsTheSha256OfGridAndTriangles) {
  const Grid grid{10, {1.5, -2, 0.25}, 7.5};
  std::vector<FixedTriangle> triangles(1000);
  int64_t next = 1;
  for (FixedTriangle& t : triangles)
    for (auto& vertex : t.v)
      for (int64_t& u : vertex) u = next += 2;
  triangles[300].v[1][2] = int64_t{1} << 31;     // does not fit 32 bits
  triangles[301].v[0][0] = -(int64_t{1} << 31);  // is what tells that
  triangles[302].v[0][0] = (int64_t{1} << 31) - 1;
  Sha256 expected;
  const double numbers[] = {1024, 1.5, -2, 0.25, 7.5};
  expected.add(std::as_bytes(std::span(numbers)));
  for (size_t i = 0; i < triangles.size(); ++i) {
    const bool wide = i == 300 || i == 301;
    const int32_t mark = INT32_MIN;
    if (wide) expected.add(std::as_bytes(std::span(&mark, 1)));
    for (const auto& vertex : triangles[i].v)
      for (const int64_t coordinate : vertex) {
        const int32_t narrow = static_cast<int32_t>(coordinate);
        expected.add(wide ? std::as_bytes(std::span(&coordinate, 1))
                          : std::as_bytes(std::span(&narrow, 1)));
      }
  }

  ContentDigest digest(grid);
  digest.add(std::span(triangles).first(7));
  const ContentDigest copy = digest;
  digest.add(std::span(triangles).first(1));
  ContentDigest again = copy;
  again.add(std::span(triangles).subspan(7, 500));
  again.add(std::span(triangles).subspan(507));
  EXPECT_EQ(again.hex(), expected.finish());
  EXPECT_NE(digest.hex(), copy.hex());
}

}  // namespace
}  // namespace voxdag
