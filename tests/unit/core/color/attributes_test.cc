// Compares alpha, normals and materials of cells with values computed in doubles by brute force
// from the same triangles.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "core/color/blocks/value_region.h"
#include "core/color/color_of.h"
#include "core/geometry/morton.h"
#include "tests/oracle/overlap.h"
#include "tests/unit/core/color/looks.h"

namespace voxdag {
namespace {

using Vector = std::array<double, 3>;

double length(const Vector& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

double degrees_between(const Vector& a, const Vector& b) {
  const double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  return std::acos(std::clamp(dot / (length(a) * length(b)), -1.0, 1.0)) * 180 / std::acos(-1.0);
}

// Decodes a normal with the published formulas of the octahedral encoding.
Vector direction_of(NormalCode code) {
  const double p = ((code & 255) - 127.0) / 127, q = ((code >> 8) - 127.0) / 127;
  Vector v{p, q, 1 - std::abs(p) - std::abs(q)};
  if (v[2] < 0) {
    v[0] = (1 - std::abs(q)) * (p < 0 ? -1 : 1);
    v[1] = (1 - std::abs(p)) * (q < 0 ? -1 : 1);
  }
  return v;
}

TEST(NormalCode, IsNearTheDirection) {
  oracle::Random random(1);
  double largest = 0;
  for (int i = 0; i < 200000; ++i) {
    const int64_t widest = i % 2 ? int64_t{1} << 52 : 9;
    int64_t v[3];
    for (int64_t& x : v) x = random.between(-widest, widest);
    if (v[0] == 0 && v[1] == 0 && v[2] == 0) continue;
    const NormalCode code = encode_normal(v[0], v[1], v[2]);
    ASSERT_LE(code & 255, 254);
    ASSERT_LE(code >> 8, 254);
    const Vector exact{static_cast<double>(v[0]), static_cast<double>(v[1]),
                       static_cast<double>(v[2])};
    largest = std::max(largest, degrees_between(exact, direction_of(code)));
  }
  EXPECT_LT(largest, 0.95);
  EXPECT_GT(largest, 0.5);
}

TEST(NormalCode, DirectionsAreThoseOfTheirCodes) {
  for (int p = 0; p <= 254; ++p)
    for (int q = 0; q <= 254; ++q) {
      const auto code = static_cast<NormalCode>(p | q << 8);
      const auto d = decode_normal(code);
      const Vector v{static_cast<double>(d[0]), static_cast<double>(d[1]),
                     static_cast<double>(d[2])};
      ASSERT_NEAR(length(v), 16384, 1);
      ASSERT_LT(degrees_between(v, direction_of(code)), 0.01) << p << " " << q;
      // Encoding a decoded direction gives the same code. The exception is directions with z <= 0,
      // where several codes can have the same direction.
      const NormalCode again = encode_normal(d[0], d[1], d[2]);
      ASSERT_TRUE(again == code || d[2] <= 0);
      ASSERT_LT(degrees_between(v, direction_of(again)), 0.01);
    }
}

TEST(NormalCode, OfTheAxes) {
  EXPECT_EQ(encode_normal(0, 0, 5), 127 << 8 | 127);
  EXPECT_EQ(encode_normal(7, 0, 0), 127 << 8 | 254);
  EXPECT_EQ(encode_normal(-7, 0, 0), 127 << 8 | 0);
  EXPECT_EQ(encode_normal(0, 1, 0), 254 << 8 | 127);
  EXPECT_EQ(encode_normal(0, 0, -3), 254 << 8 | 254);
}

TEST(ValueOfParent, FollowsTheChildren) {
  const auto of = [](Attribute attribute, std::vector<uint32_t> children) {
    return traits_of(attribute).value_of_parent(children);
  };
  EXPECT_EQ(of(Attribute::kAlpha, {255}), 255u);
  EXPECT_EQ(of(Attribute::kAlpha, {0, 1}), 1u);
  EXPECT_EQ(of(Attribute::kAlpha, {0, 0, 1}), 0u);
  EXPECT_EQ(of(Attribute::kAlpha, {255, 255, 255, 255, 255, 255, 255, 254}), 255u);
  EXPECT_EQ(of(Attribute::kMaterial, {5, 3, 3, 5, 9}), 3u);
  EXPECT_EQ(of(Attribute::kMaterial, {70000, 3, 70000}), 70000u);
  const uint32_t up = encode_normal(0, 0, 1), down = encode_normal(0, 0, -1),
                 right = encode_normal(1, 0, 0);
  EXPECT_EQ(of(Attribute::kNormal, {up, right}), encode_normal(1, 0, 1));
  EXPECT_EQ(of(Attribute::kNormal, {down, up, right}), right);
  EXPECT_EQ(of(Attribute::kNormal, {down, up}), down);
  // Equal codes are unchanged.
  EXPECT_EQ(of(Attribute::kNormal, {0u, 0u}), 0u);
}

// The expected values of a cell. `area` is the sum of the triangles' area vectors. `turned` is the
// sum of the same vectors, each turned to the positive side of its dominant axis, so that the two
// sides of a thin sheet do not cancel out.
struct ExpectedCell {
  double weight = 0, alpha = 0;
  Vector area{}, turned{};
  std::map<uint32_t, double> weights;  // by material
};

class BruteForce {
 public:
  BruteForce(const ColorGrid& grid, const TestLooks& looks)
      : looks_(looks), edge_(int64_t{1} << grid.cell_bits()) {}

  ExpectedCell cell(const std::vector<FixedSurface>& surfaces, const std::array<uint32_t, 3>& at) {
    for (size_t a = 0; a < 3; ++a) low_[a] = at[a] * edge_;
    ExpectedCell covered, touched;
    bool is_covered = false;
    for (const FixedSurface& surface : surfaces) {
      if (!oracle::touches(plain(surface.position), {low_[0], low_[1], low_[2]}, edge_)) continue;
      const int columns = columns_of(surface.position);
      is_covered |= columns > 0;
      if (columns > 0) add(surface, columns, true, covered);
      add(surface, 1, false, touched);
    }
    return is_covered ? covered : touched;
  }

 private:
  static Vector normal_of(const FixedTriangle& t, int& dominant) {
    Vector n;
    for (size_t a = 0; a < 3; ++a) {
      const size_t b = (a + 1) % 3, c = (a + 2) % 3;
      n[a] = static_cast<double>((t.v[1][b] - t.v[0][b]) * (t.v[2][c] - t.v[0][c]) -
                                 (t.v[1][c] - t.v[0][c]) * (t.v[2][b] - t.v[0][b]));
    }
    dominant = std::abs(n[1]) > std::abs(n[0]) ? 1 : 0;
    if (std::abs(n[2]) > std::abs(n[static_cast<size_t>(dominant)])) dominant = 2;
    return n;
  }

  // Returns the number of the cell's 16 columns that the triangle covers (docs/color.md). The
  // columns are parallel to the dominant axis of the triangle's normal. A triangle covers a column
  // if the column meets the triangle within the cell. Positions of columns are odd eighths of the
  // cell's edge, which are integers.
  int columns_of(const FixedTriangle& t) const {
    int dominant;
    const Vector n = normal_of(t, dominant);
    const auto z = static_cast<size_t>(dominant), x = (z + 1) % 3, y = (z + 2) % 3;
    if (n[z] == 0) return 0;
    int count = 0;
    for (int64_t i = 0; i < 4; ++i)
      for (int64_t j = 0; j < 4; ++j) {
        const int64_t px = low_[x] + edge_ * (2 * i + 1) / 8,
                      py = low_[y] + edge_ * (2 * j + 1) / 8;
        bool is_inside = true;
        for (int k = 0; k < 3; ++k) {
          const auto &a = t.v[k], &b = t.v[(k + 1) % 3];
          const int64_t e = (b[x] - a[x]) * (py - a[y]) - (b[y] - a[y]) * (px - a[x]);
          is_inside &= n[z] > 0 ? e >= 0 : e <= 0;
        }
        // Compares heights multiplied by |n_z|, to avoid a division.
        const double sign = n[z] > 0 ? 1 : -1;
        const double at = -sign * (n[x] * static_cast<double>(px - t.v[0][x]) +
                                   n[y] * static_cast<double>(py - t.v[0][y]));
        const auto height = [&](int64_t h) {
          return sign * n[z] * static_cast<double>(h - t.v[0][z]);
        };
        count += is_inside && at >= height(low_[z]) && at <= height(low_[z] + edge_);
      }
    return count;
  }

  void add(const FixedSurface& surface, int columns, bool is_weighted, ExpectedCell& cell) const {
    const Material& material = looks_.materials[surface.material];
    int dominant;
    const Vector n = normal_of(surface.position, dominant);
    const double up = n[static_cast<size_t>(dominant)];
    const double weight = is_weighted ? columns * length(n) / std::abs(up) : 1;
    cell.weight += weight;
    cell.weights[material.number] += is_weighted ? weight : 1;
    const uint32_t alpha = material.factor[3];
    cell.alpha += weight * (material.alpha_mode == AlphaMode::kOpaque ? 255.0
                            : material.alpha_mode == AlphaMode::kMask
                                ? (alpha >= material.alpha_cutoff ? 255.0 : 0.0)
                                : alpha * 255.0 / 65535);
    if (up == 0) return;
    for (size_t a = 0; a < 3; ++a) {
      const double area = columns * n[a] / std::abs(up);
      cell.area[a] += surface.is_flipped ? -area : area;
      cell.turned[a] += columns * n[a] / up;
    }
  }

  const TestLooks& looks_;
  const int64_t edge_;
  int64_t low_[3] = {};
};

double largest_of(const Vector& v) {
  return std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])});
}

// The baked values are near the brute-force values. Scenes have triangles of all kinds, some of
// them flipped, and materials with different alpha.
TEST(Attributes, AreThoseOfTheTriangles) {
  TestLooks looks;
  for (uint32_t i = 0; i < looks.materials.size(); ++i) {
    Material& m = looks.materials[i];
    m.image = Material::kNoImage;
    m.factor[3] = static_cast<uint16_t>(7000 * i);
    m.number = i / 2;  // two materials share a number
  }
  size_t cells_seen = 0, turned_cells = 0, mixed_cells = 0;
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    if (kind == oracle::SceneKind::kWide) continue;  // BruteForce would overflow
    for (const ColorGrid grid : {ColorGrid{4, 4}, ColorGrid{6, 3}}) {
      SCOPED_TRACE(oracle::kind_name(kind) + " " + std::to_string(grid.levels));
      const oracle::Region whole{{0, 0, 0}, 1 << grid.levels};
      auto surfaces = looks.surfaces(oracle::make_scene(kind, 21, whole, 40), 21);
      for (size_t i = 0; i < surfaces.size(); ++i) {
        surfaces[i].is_flipped = i % 3 == 1;
        for (SurfaceCorner& corner : surfaces[i].corners) corner.color = SurfaceCorner{}.color;
      }
      const AttributeSet wanted{Attribute::kAlpha, Attribute::kNormal, Attribute::kMaterial};
      RegionBaker<const TestImages> baker(grid, looks.materials, looks.images, wanted);
      std::vector<ColoredCell> cells;
      std::vector<CellValues> values;
      baker.begin(Cube{});
      baker.add(surfaces);
      baker.finish(cells, values);
      ASSERT_EQ(cells.size(), values.size());
      BruteForce oracle(grid, looks);
      for (size_t i = 0; i < cells.size(); ++i) {
        std::array<uint32_t, 3> at;
        morton_decode(cells[i].code, at[0], at[1], at[2]);
        const ExpectedCell expected = oracle.cell(surfaces, at);
        ASSERT_GT(expected.weight, 0);
        ASSERT_NEAR(alpha_of(cells[i].sum), expected.alpha / expected.weight, 1.5);

        double heaviest = 0;
        for (const auto& [material, weight] : expected.weights)
          heaviest = std::max(heaviest, weight);
        const double weight = expected.weights.at(values[i].material);
        ASSERT_GE(weight, 0.98 * heaviest);
        for (const auto& [material, other] : expected.weights)
          ASSERT_TRUE(other != weight || values[i].material <= material);

        // The rule takes the normal from `turned` if the largest component of `area` is less than
        // 1/64 of the largest component of `turned`. Near this limit, the normals of both are
        // accepted, because of rounding.
        const double rest = largest_of(expected.area), turned = largest_of(expected.turned);
        const double from_rest =
            rest == 0 ? 180 : degrees_between(expected.area, direction_of(values[i].normal));
        const double from_turned =
            turned == 0 ? 180 : degrees_between(expected.turned, direction_of(values[i].normal));
        if (rest == 0 && turned == 0) {
          ASSERT_EQ(values[i].normal, kNoNormal);
        } else {
          const bool may_be_rest = 64 * rest > 0.99 * turned;
          const bool may_be_turned = 64 * rest < 1.01 * turned;
          ASSERT_LT(std::min(may_be_rest ? from_rest : 180, may_be_turned ? from_turned : 180),
                    1.0);
        }
        ++cells_seen;
        turned_cells += 64 * rest < turned;
        mixed_cells += expected.weights.size() > 1;
      }
    }
  }
  EXPECT_GT(cells_seen, 5000u);
  EXPECT_GT(turned_cells, 20u);
  EXPECT_GT(mixed_cells, 500u);
}

// The normals and materials of cells do not depend on the order of the triangles or their division
// into parts.
TEST(Attributes, AreFunctionsOfTheCell) {
  TestLooks looks;
  for (uint32_t i = 0; i < looks.materials.size(); ++i) looks.materials[i].number = i;
  const ColorGrid grid{8, 4};
  const oracle::Region whole{{0, 0, 0}, 1 << grid.levels};
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    SCOPED_TRACE(oracle::kind_name(kind));
    auto surfaces = looks.surfaces(oracle::make_scene(kind, 4, whole, 40), 4);
    RegionBaker<const TestImages> baker(grid, looks.materials, looks.images,
                                        {Attribute::kNormal, Attribute::kMaterial});
    const auto bake = [&](size_t part) {
      std::vector<ColoredCell> cells;
      std::vector<CellValues> values;
      baker.begin(Cube{});
      for (size_t at = 0; at < surfaces.size(); at += part)
        baker.add(std::span(surfaces).subspan(at, std::min(part, surfaces.size() - at)));
      baker.finish(cells, values);
      std::vector<std::array<uint32_t, 3>> all;
      for (size_t i = 0; i < cells.size(); ++i)
        all.push_back({cells[i].code, values[i].normal, values[i].material});
      return all;
    };
    const auto expected = bake(surfaces.size());
    ASSERT_FALSE(expected.empty());
    std::reverse(surfaces.begin(), surfaces.end());
    EXPECT_EQ(bake(1), expected);
    std::rotate(surfaces.begin(), surfaces.begin() + 13, surfaces.end());
    EXPECT_EQ(bake(7), expected);
  }
}

}  // namespace
}  // namespace voxdag
