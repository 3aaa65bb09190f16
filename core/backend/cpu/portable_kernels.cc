#include <utility>

#include "core/backend/cpu/draw_portable.h"
#include "core/backend/cpu/kernels.h"
#include "core/backend/cpu/octant_test.h"

namespace voxdag::cpu {
namespace {

struct PlainQuad {
  double x[4];

  explicit PlainQuad(double all) : x{all, all, all, all} {}
  PlainQuad(double x0, double x1, double x2, double x3) : x{x0, x1, x2, x3} {}
  template <class Coordinate>
  static PlainQuad load(const Coordinate (&v)[3], int64_t origin) {
    return {static_cast<double>(v[0] - origin), static_cast<double>(v[1] - origin),
            static_cast<double>(v[2] - origin), 0.0};
  }
  PlainQuad operator+(const PlainQuad& o) const {
    return {x[0] + o.x[0], x[1] + o.x[1], x[2] + o.x[2], x[3] + o.x[3]};
  }
  PlainQuad operator-(const PlainQuad& o) const {
    return {x[0] - o.x[0], x[1] - o.x[1], x[2] - o.x[2], x[3] - o.x[3]};
  }
  PlainQuad operator*(const PlainQuad& o) const {
    return {x[0] * o.x[0], x[1] * o.x[1], x[2] * o.x[2], x[3] * o.x[3]};
  }
  PlainQuad rotated() const { return {x[1], x[2], x[0], x[3]}; }
  PlainQuad above_zero() const {
    PlainQuad out(0.0);
    for (int i = 0; i < 4; ++i) out.x[i] = x[i] > 0 ? x[i] : 0;
    return out;
  }
  uint32_t negative() const {
    uint32_t bits = 0;
    for (int i = 0; i < 4; ++i) bits |= (x[i] < 0 ? 1u : 0u) << i;
    return bits;
  }
};

Octants test_octants_narrow(const NarrowTriangle& triangle, const Box& cube, bool inside) {
  return OctantTest<PlainQuad, int32_t>(triangle, cube).run(inside);
}

BrickCount collect(TileBricks& tile, int words, uint64_t* existing, uint64_t* masks) {
  BrickCount found{0, 0};
  for (int w = 0; w < words; ++w) {
    uint64_t bits = 0;
    for (int node = 8 * w; node < 8 * w + 8; ++node) {
      if (!std::exchange(tile.touched[node], 0)) continue;
      for (int i = 8 * node; i < 8 * node + 8; ++i) {
        const uint64_t mask = std::exchange(tile.masks[i], 0);
        if (mask == 0) continue;
        bits |= uint64_t{1} << i % 64;
        found.voxels += static_cast<uint64_t>(popcount64(mask));
        masks[found.bricks++] = mask;
      }
    }
    existing[w] = bits;
  }
  return found;
}

void find_in_range(const int64_t* values, int count, int64_t least, int64_t most, uint64_t* bits) {
  for (int i = 0; i < count; i += 64) {
    uint64_t word = 0;
    for (int j = 0; j < 64 && i + j < count; ++j)
      word |= uint64_t{values[i + j] >= least && values[i + j] <= most} << j;
    bits[i / 64] = word;
  }
}

constexpr Kernels kPortable = {draw_exactly<int32_t>, test_octants_narrow, find_in_range, collect};

}  // namespace

const Kernels& portable_kernels() { return kPortable; }

Octants test_octants_wide(const WideTriangle& triangle, const Box& cube, bool inside) {
  return OctantTest<PlainQuad, int64_t>(triangle, cube).run(inside);
}

}  // namespace voxdag::cpu
