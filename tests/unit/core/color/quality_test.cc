// Compares two kinds of colors with the oracle's mean color of the surface in each cell: the baked
// colors, which test the color rule, and the colors stored in blocks. The required signal-to-noise
// ratios are up to 1 dB below the measured values.
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "core/color/blocks/block_codec.h"
#include "core/color/color_of.h"
#include "core/format/global/voxdag_reader_colors.h"
#include "tests/oracle/surface_color.h"
#include "tests/unit/core/color/looks.h"

namespace voxdag {
namespace {

// A bumpy sheet across the grid, with one material.
struct Sheet {
  static constexpr int kQuads = 12;

  // `images` is the number of times that the texture repeats along an edge of the grid.
  Sheet(const ColorGrid& sheet_grid, double images, const Material& m) : grid(sheet_grid) {
    material = m;
    for (int i = 0; i < kQuads; ++i)
      for (int j = 0; j < kQuads; ++j) {
        add({corner(i, j, images), corner(i + 1, j, images), corner(i + 1, j + 1, images)});
        add({corner(i, j, images), corner(i + 1, j + 1, images), corner(i, j + 1, images)});
      }
  }

  ColorGrid grid;
  Material material;
  std::vector<FixedSurface> surfaces;

 private:
  struct Corner {
    std::array<int64_t, 3> position;
    SurfaceCorner look;
  };
  Corner corner(int i, int j, double images) const {
    const double whole = static_cast<double>(int64_t{1} << (grid.levels + 8));
    const double x = (i + 0.37) / (kQuads + 1), z = (j + 0.61) / (kQuads + 1);
    const double y = 0.4 + ((i * 7 + j * 5) % 11) / 110.0 + 0.02 * i / kQuads;
    const auto lattice = [&](double v) { return static_cast<int64_t>(v * whole) | 1; };
    const auto texture = [&](double v) { return static_cast<int64_t>(v * images * 0x1p24); };
    Corner out{{lattice(x), lattice(y), lattice(z)}, {}};
    out.look.texture = {texture(x + 0.1 * z), texture(z - 0.2 * x)};
    if (material.name == "painted")
      out.look.color = {static_cast<uint16_t>(65535 - 4000 * i), 65535,
                        static_cast<uint16_t>(20000 + 3600 * j), 65535};
    return out;
  }
  void add(const std::array<Corner, 3>& corners) {
    FixedSurface surface;
    for (size_t i = 0; i < 3; ++i) {
      for (size_t a = 0; a < 3; ++a) surface.position.v[i][a] = corners[i].position[a];
      surface.corners[i] = corners[i].look;
    }
    surfaces.push_back(surface);
  }
};

// The sheet and its image in the oracle's types.
struct OracleScene {
  OracleScene(const Sheet& sheet, const TestImages& images) {
    const TestLevel& from = images.image(0);
    image.width = static_cast<int>(from.width);
    image.height = static_cast<int>(from.height);
    for (const auto& texel : from.texels) {
      auto& to = image.texels.emplace_back();
      for (size_t c = 0; c < 4; ++c) to[c] = static_cast<float>(texel[c]) / 65535;
    }
    const Material& m = sheet.material;
    if (m.image != Material::kNoImage) material.image = &image;
    for (size_t c = 0; c < 4; ++c) material.factor[c] = m.factor[c] / 65535.0;
    for (size_t a = 0; a < 2; ++a) material.borders[a] = static_cast<oracle::Border>(m.wrap[a]);
    material.transparency = static_cast<oracle::Transparency>(m.alpha_mode);
    material.cutoff = m.alpha_cutoff / 65535.0;
    for (const FixedSurface& surface : sheet.surfaces) {
      oracle::Surface& to = surfaces.emplace_back();
      to.position = plain(surface.position);
      to.material = &material;
      for (size_t i = 0; i < 3; ++i) {
        for (size_t a = 0; a < 2; ++a)
          to.corners[i].texture[a] = static_cast<double>(surface.corners[i].texture[a]) / 0x1p24;
        for (size_t c = 0; c < 4; ++c)
          to.corners[i].color[c] = surface.corners[i].color[c] / 65535.0;
      }
    }
  }
  // Returns the surfaces whose bounding boxes reach the cube.
  std::vector<const oracle::Surface*> near(const oracle::Point& low, int64_t edge) const {
    std::vector<const oracle::Surface*> out;
    for (const oracle::Surface& surface : surfaces) {
      bool reaches = true;
      for (size_t a = 0; a < 3; ++a) {
        const auto [least, most] =
            std::minmax({surface.position[0][a], surface.position[1][a], surface.position[2][a]});
        reaches &= most >= low[a] && least <= low[a] + edge;
      }
      if (reaches) out.push_back(&surface);
    }
    return out;
  }
  oracle::ColorImage image;
  oracle::SurfaceMaterial material;
  std::deque<oracle::Surface> surfaces;
};

struct Quality {
  oracle::ColorError rule, blocks;
  uint64_t without_area = 0;
};

Quality quality_of(const Sheet& sheet, const TestImages& images) {
  std::vector<ColoredCell> cells;
  const Material materials[] = {sheet.material};
  bake_region(sheet.grid, Cube{}, sheet.surfaces, materials, images, cells);
  const OracleScene scene(sheet, images);
  const int64_t edge = int64_t{1} << sheet.grid.cell_bits();
  Quality quality;
  std::vector<Color> colors;
  for (const ColoredCell& cell : cells) colors.push_back(color_of(cell.sum));
  ColorBlock block{};
  for (size_t i = 0; i < cells.size(); ++i) {
    if (i % kBlockCells == 0)
      block = encode_block_portable(&colors[i], std::min(kBlockCells, colors.size() - i));
    uint32_t at[3];
    morton_decode(cells[i].code, at[0], at[1], at[2]);
    const oracle::Point low{at[0] * edge, at[1] * edge, at[2] * edge};
    const auto mean = oracle::mean_color(scene.near(low, edge), low, edge);
    if (!mean) {
      ++quality.without_area;
      continue;
    }
    const auto stored =
        voxdag_reader::block_color(reinterpret_cast<const unsigned char*>(block.data()),
                                   static_cast<unsigned>(i % kBlockCells));
    quality.rule.add(*mean, colors[i].rgb);
    quality.blocks.add(*mean, {stored.r, stored.g, stored.b});
  }
  EXPECT_GT(quality.rule.colors(), 1500u);
  EXPECT_LT(quality.without_area, 20u);
  return quality;
}

void expect_quality(const Sheet& sheet, const TestImages& images, double rule, double blocks) {
  const Quality quality = quality_of(sheet, images);
  EXPECT_GT(quality.rule.psnr(), rule);
  EXPECT_GT(quality.blocks.psnr(), blocks);
}

class ColorQuality : public testing::Test {
 protected:
  ColorQuality() { images_.add(64, 64, 1); }
  static Material textured() {
    Material material;
    material.image = 0;
    return material;
  }
  TestImages images_;
};

// Tests the oracle itself with known answers, in a cube of edge 256, on surfaces at z = 100.
class ColorOracle : public testing::Test {
 protected:
  void add(double from_x, double to_x, const oracle::SurfaceMaterial& material) {
    const auto corner = [&](double x, double y) {
      oracle::Surface::Corner out;
      out.texture = {x / 256, y / 256};
      return std::pair(oracle::Point{static_cast<int64_t>(x), static_cast<int64_t>(y), 100}, out);
    };
    const std::pair<oracle::Point, oracle::Surface::Corner> corners[] = {
        corner(from_x, -900), corner(to_x, -900), corner(to_x, 700), corner(from_x, 700)};
    for (const auto& [b, c] : {std::pair(1, 2), std::pair(2, 3)}) {
      oracle::Surface& surface = surfaces_.emplace_back();
      surface.material = &material;
      for (size_t i = 0; const int k : {0, b, c}) {
        surface.position[i] = corners[k].first;
        surface.corners[i++] = corners[k].second;
      }
    }
  }
  std::optional<std::array<uint8_t, 3>> mean() const {
    std::vector<const oracle::Surface*> all;
    for (const oracle::Surface& surface : surfaces_) all.push_back(&surface);
    return oracle::mean_color(all, {0, 0, 0}, 256);
  }
  std::deque<oracle::Surface> surfaces_;
};
using Bytes = std::array<uint8_t, 3>;

TEST_F(ColorOracle, WeighsByAreaInLinearLight) {
  oracle::SurfaceMaterial red, blue;
  red.factor = {1, 0, 0, 1};
  blue.factor = {0, 0, 1, 1};
  add(-800, 64, red);
  add(64, 5000, blue);
  EXPECT_EQ(mean(), (Bytes{137, 0, 225}));  // 1/4 red, 3/4 blue
  blue.factor[3] = 1.0 / 3;
  blue.transparency = oracle::Transparency::kBlend;
  EXPECT_EQ(mean(), (Bytes{188, 0, 188}));
  blue.transparency = oracle::Transparency::kCutoff;
  EXPECT_EQ(mean(), (Bytes{255, 0, 0}));
}

TEST_F(ColorOracle, LooksAtTheTextureInTheCube) {
  oracle::ColorImage ramp{64, 1, {}};
  for (int i = 0; i < 64; ++i)
    ramp.texels.push_back({(static_cast<float>(i) + 0.5F) / 64, i < 16 ? 1.0F : 0.0F, 0, 1});
  oracle::SurfaceMaterial material;
  material.image = &ramp;
  material.borders = {oracle::Border::kClamp, oracle::Border::kClamp};
  add(-256, 512, material);
  const auto color = mean();
  ASSERT_TRUE(color);
  EXPECT_NEAR((*color)[0], 188, 1);
  EXPECT_NEAR((*color)[1], 137, 2);
  EXPECT_EQ((*color)[2], 0);
}

TEST_F(ColorOracle, HasNoColorWithoutArea) {
  EXPECT_FALSE(mean());
  const oracle::SurfaceMaterial white;
  add(256, 900, white);
  EXPECT_FALSE(mean());
  add(255, 256, white);
  EXPECT_EQ(mean(), (Bytes{255, 255, 255}));
}

constexpr ColorGrid kFine{5, 5}, kCoarse{11, 5};

// Colors are near the oracle's for textures with 0.2 to 10 texels along the edge of a cell.
TEST_F(ColorQuality, OfTextures) {
  for (const ColorGrid grid : {kFine, kCoarse}) {
    SCOPED_TRACE(grid.levels);
    expect_quality({grid, 0.1, textured()}, images_, 50, 33);
    expect_quality({grid, 0.3, textured()}, images_, 41.5, 25);
    expect_quality({grid, 1, textured()}, images_, 29.5, 19.5);
    expect_quality({grid, 5, textured()}, images_, 23, 23);
  }
}

// At the border of an image, the coarser levels of its pyramid (mipmaps) are less sharp than the
// image, so the required signal-to-noise ratios are lower.
TEST_F(ColorQuality, OfBorders) {
  for (const Wrap wrap : {Wrap::kClampToEdge, Wrap::kMirroredRepeat}) {
    Material material = textured();
    material.wrap = {wrap, Wrap::kMirroredRepeat};
    expect_quality({kFine, 1.7, material}, images_, 22.5, 19);
  }
}

TEST_F(ColorQuality, OfTransparency) {
  for (const AlphaMode mode : {AlphaMode::kMask, AlphaMode::kBlend}) {
    Material material = textured();
    material.alpha_mode = mode;
    expect_quality({kFine, 0.5, material}, images_, 33.5, 21.5);
  }
}

TEST_F(ColorQuality, OfVertexColors) {
  Material material;
  material.name = "painted";
  material.factor = {60000, 50000, 65535, 65535};
  expect_quality({kFine, 1, material}, images_, 58.5, 39.5);
}

}  // namespace
}  // namespace voxdag
