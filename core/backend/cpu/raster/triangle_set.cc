#include "core/backend/cpu/raster/triangle_set.h"

#include "core/base/integers.h"

namespace voxdag::cpu {

bool is_in_plane(const NarrowTriangle& other, const NarrowTriangle& t) {
  for (int a = 0; a < 3; ++a)
    if (t.v[a][0] == t.v[a][1] && t.v[a][1] == t.v[a][2])
      return t.v[a][0] == other.v[a][0] && t.v[a][0] == other.v[a][1] && t.v[a][0] == other.v[a][2];
  // The extents of narrow triangles are at most 2^28, so the normal is below 2^58.
  int64_t edge[3][2];
  for (int a = 0; a < 3; ++a)
    for (int i = 0; i < 2; ++i) edge[a][i] = int64_t{t.v[a][i + 1]} - t.v[a][i];
  int128 heights[3] = {};
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    const int64_t n = edge[b][0] * edge[c][1] - edge[c][0] * edge[b][1];
    for (int i = 0; i < 3; ++i)
      heights[i] += static_cast<int128>(n) * (int64_t{other.v[a][i]} - t.v[a][0]);
  }
  return heights[0] == 0 && heights[1] == 0 && heights[2] == 0;
}

void TriangleSet::add(const WideTriangle& triangle) {
  const bool narrow = is_narrow(triangle);
  uint32_t& count = narrow ? narrow_count_ : wide_count_;
  if (count + 1 >= Entry::kWide) throw OutOfBudget{};
  if (narrow) {
    if (count + 2 > narrow_.size()) narrow_.grow(memory_, count + 2);
    narrow_[count] = narrowed(triangle);
  } else {
    if (count + 1 > wide_.size()) wide_.grow(memory_, count + 1);
    wide_[count] = triangle;
  }
  ++count;
}

void TriangleSet::clear() {
  narrow_ = {};
  wide_ = {};
  narrow_count_ = wide_count_ = 0;
}

}  // namespace voxdag::cpu
