#include "bench/color_quality/sampled_cells.h"

#include <algorithm>
#include <cmath>

namespace voxdag {
namespace {

// Returns a hash of the code: the finalizer of the random number generator SplitMix64.
uint64_t hash_of(uint64_t code) {
  code += 0x9e3779b97f4a7c15u;
  code = (code ^ code >> 30) * 0xbf58476d1ce4e5b9u;
  code = (code ^ code >> 27) * 0x94d049bb133111ebu;
  return code ^ code >> 31;
}

uint64_t count_colored(const voxdag_reader::File& file) {
  const voxdag_reader::ColorTier& tier = file.colors().tier(0);
  uint64_t cells = 0;
  voxdag_reader::ColorRegion region;
  for (uint64_t i = 0; i < tier.region_count; ++i) {
    if (!voxdag_reader::ColorSection::region(tier, i, region))
      file.broken_section(file.colors(),
                          "region " + std::to_string(i) + " of the finest tier is damaged");
    cells += region.counts[0];
  }
  return cells;
}

// Calls `visit` for each set cell of a level. Depending on the level, a cell is a node, a brick, an
// octant of a brick or a voxel.
template <class Visit>
struct CellVisitor {
  uint32_t level;  // level of the cells
  uint32_t shift;  // log2 of a cell's edge in voxels
  Visit visit;

  bool node(uint32_t l, int64_t x, int64_t y, int64_t z, uint64_t) {
    if (l == level) visit(x >> shift, y >> shift, z >> shift);
    return l < level;
  }
  void brick(int64_t x, int64_t y, int64_t z, uint64_t mask, uint64_t) {
    if (shift == 2) return visit(x >> 2, y >> 2, z >> 2);
    for (unsigned child = 0; child < 8; ++child) {
      const uint64_t voxels = mask >> 8 * child & 255;
      if (voxels == 0) continue;
      const int64_t cx = x + 2 * (child >> 2), cy = y + 2 * (child >> 1 & 1),
                    cz = z + 2 * (child & 1);
      if (shift == 1) visit(cx >> 1, cy >> 1, cz >> 1);
      for (unsigned i = 0; shift == 0 && i < 8; ++i)
        if (voxels >> i & 1) visit(cx + (i >> 2), cy + (i >> 1 & 1), cz + (i & 1));
    }
  }
};

}  // namespace

SampledCells::SampledCells(const voxdag_reader::File& file, uint64_t wanted)
    : color_levels_(file.color_levels()),
      cell_bits_(8 + static_cast<int>(file.grid_levels() - file.color_levels())),
      file_cells_(count_colored(file)) {
  const double part = static_cast<double>(wanted) / static_cast<double>(file_cells_);
  const uint64_t below = part >= 1 ? ~uint64_t{0} : static_cast<uint64_t>(std::ldexp(part, 64));
  const auto visit = [&](int64_t x, int64_t y, int64_t z) {
    const uint64_t code = voxdag_reader::morton_code(x, y, z);
    if (hash_of(code) > below) return;
    positions_.push_back(
        {static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z)});
    codes_.push_back(code);
  };
  file.walk(CellVisitor<decltype(visit)>{color_levels_, file.grid_levels() - color_levels_, visit});
}

// The plane of a triangle: normal . x = offset.
struct SampledCells::Plane {
  explicit Plane(const FixedTriangle& t) {
    double u[3], v[3];
    for (int a = 0; a < 3; ++a) {
      u[a] = static_cast<double>(t.v[1][a] - t.v[0][a]);
      v[a] = static_cast<double>(t.v[2][a] - t.v[0][a]);
    }
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      normal[a] = u[b] * v[c] - u[c] * v[b];
      offset += normal[a] * static_cast<double>(t.v[0][a]);
      length += std::abs(normal[a]);
    }
  }
  // True if the plane misses the cube with this center and half edge, whatever the rounding errors.
  bool misses(const double (&center)[3], double half) const {
    double distance = -offset, scale = std::abs(offset);
    for (int a = 0; a < 3; ++a) {
      distance += normal[a] * center[a];
      scale += std::abs(normal[a] * center[a]);
    }
    return std::abs(distance) > half * length + 1e-12 * scale;
  }
  double normal[3], offset = 0, length = 0;
};

void SampledCells::descend(const Plane& plane, const FixedTriangle& triangle, uint32_t level,
                           CellPosition low, size_t first, size_t last,
                           std::vector<uint32_t>& cells) const {
  const uint32_t down = color_levels_ - level;
  const int64_t edge = int64_t{1} << (cell_bits_ + static_cast<int>(down));
  double center[3];
  for (size_t a = 0; a < 3; ++a) {
    const int64_t at = static_cast<int64_t>(low[a]) << cell_bits_;
    const auto [least, most] = std::minmax({triangle.v[0][a], triangle.v[1][a], triangle.v[2][a]});
    if (most < at || least > at + edge) return;
    center[a] = static_cast<double>(at) + 0.5 * static_cast<double>(edge);
  }
  if (plane.misses(center, 0.5 * static_cast<double>(edge))) return;
  if (down == 0) return cells.push_back(static_cast<uint32_t>(first));
  const uint32_t half = 1u << (down - 1), shift = 3 * (down - 1);
  for (uint64_t child = 0; child < 8; ++child) {
    const uint64_t begin = (codes_[first] >> shift & ~uint64_t{7}) | child;
    const auto in_child =
        std::partition_point(codes_.begin() + static_cast<ptrdiff_t>(first),
                             codes_.begin() + static_cast<ptrdiff_t>(last),
                             [&](uint64_t code) { return code >> shift <= begin; });
    const auto end = static_cast<size_t>(in_child - codes_.begin());
    if (end == first) continue;
    CellPosition corner = low;
    for (size_t a = 0; a < 3; ++a) corner[a] += (child >> (2 - a) & 1) * half;
    descend(plane, triangle, level + 1, corner, first, end, cells);
    first = end;
    if (first == last) return;
  }
}

void SampledCells::find_near(const FixedTriangle& triangle, std::vector<uint32_t>& cells) const {
  if (!codes_.empty()) descend(Plane(triangle), triangle, 0, {0, 0, 0}, 0, codes_.size(), cells);
}

}  // namespace voxdag
