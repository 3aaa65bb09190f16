// Compares the colors that SampleKernels compute, for textures in memory, with the colors of the
// code that computes one cell at a time.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <vector>

#include "core/color/rule/bake_region.h"
#include "core/color/samples/sample_batch.h"
#include "tests/unit/core/color/looks.h"

namespace voxdag {
namespace {

using oracle::SceneKind;

// The images of a TestImages, in tiles if `is_tiled`. Kernels accept only tiles. Counts the texels
// that are read one by one.
class TiledImages {
 public:
  TiledImages(const TestImages& images, uint32_t count, bool is_tiled)
      : images_(images), is_tiled_(is_tiled), tiles_(count) {
    for (uint32_t image = 0; image < count; ++image)
      for (uint32_t level = 0; level < images.levels(image); ++level)
        tiles_[image].push_back(tiles_of(images.view(image, level)));
  }

  uint32_t levels(uint32_t image) const { return images_.levels(image); }
  uint32_t width(uint32_t image, uint32_t level) const { return images_.width(image, level); }
  uint32_t height(uint32_t image, uint32_t level) const { return images_.height(image, level); }
  struct View {
    TestImages::View plain;
    const std::vector<uint64_t>& tiles;
    bool is_tiled;
    uint64_t& texels_read;
    uint32_t width() const { return plain.width(); }
    uint32_t height() const { return plain.height(); }
    uint64_t texel(uint32_t x, uint32_t y) const {
      ++texels_read;
      return plain.texel(x, y);
    }
    void prefetch(uint32_t, uint32_t) const {}
    TiledLevel tiled() const {
      return {is_tiled ? tiles.data() : nullptr, width(), height(), row_of_tiles(width())};
    }
  };
  View view(uint32_t image, uint32_t level) {
    return {images_.view(image, level), tiles_[image][level], is_tiled_, texels_read};
  }

  uint64_t texels_read = 0;

 private:
  static uint32_t row_of_tiles(uint32_t width) {
    return (width + kTileEdge - 1) / kTileEdge * kTileEdge * kTileEdge;
  }
  static std::vector<uint64_t> tiles_of(const TestImages::View& view) {
    const uint32_t row = row_of_tiles(view.width());
    std::vector<uint64_t> tiles(size_t{row} * ((view.height() + kTileEdge - 1) / kTileEdge));
    for (uint32_t y = 0; y < view.height(); ++y)
      for (uint32_t x = 0; x < view.width(); ++x)
        tiles[y / kTileEdge * row + x / kTileEdge * kTileEdge * kTileEdge +
              y % kTileEdge * kTileEdge + x % kTileEdge] = view.texel(x, y);
    return tiles;
  }

  const TestImages& images_;
  const bool is_tiled_;
  std::vector<std::vector<std::vector<uint64_t>>> tiles_;
};

// Materials with all pairs of wrap modes. A third of them have an opaque image, another third have
// an image of odd size whose alpha is ignored, and the others have a mask.
struct SampledLooks : TestLooks {
  static constexpr uint32_t kImages = 3;
  Cutouts cutouts;
  MemoryBudget budget{uint64_t{1} << 20};

  SampledLooks() {
    images.add_cut(70, 40, 3);
    materials.clear();
    for (uint32_t i = 0; i < 27; ++i) {
      Material m;
      m.image = i % 3;
      m.wrap = {static_cast<Wrap>(i / 3 % 3), static_cast<Wrap>(i / 9)};
      if (m.image == 2) m.alpha_mode = AlphaMode::kMask;
      if (i % 2 == 0) m.factor = {65535, static_cast<uint16_t>(50000 + i), 1234, 65535};
      materials.push_back(m);
    }
    cutouts.materials = materials;
    AlphaMask& mask = cutouts.masks.emplace_back(70, 40, budget);
    for (uint32_t y = 0; y < 40; ++y)
      for (uint32_t x = 0; x < 70; ++x)
        if (images.image(2).at(x, y)[3] != 0) mask.set_visible(x, y);
    mask.finish();
    for (const Material& m : materials)
      cutouts.mask_of.push_back(m.image == 2 ? 0 : Cutouts::kNoMask);
  }

  std::vector<FixedSurface> scene(SceneKind kind, const ColorGrid& grid, int count,
                                  int64_t widest) const {
    const oracle::Region whole{{0, 0, 0}, 1 << grid.levels};
    auto all = surfaces(oracle::make_scene(kind, 3, whole, count), 5, widest);
    oracle::Random random(7);
    for (FixedSurface& surface : all) {
      surface.material = static_cast<uint32_t>(random.between(0, 26));
      // In cells with an edge of 2^15 voxels, a test with masks would take minutes.
      if (grid.levels == 20 && surface.material % 3 == 2) --surface.material;
      if (random.coin()) continue;
      for (SurfaceCorner& corner : surface.corners) corner.color = SurfaceCorner{}.color;
    }
    return all;
  }
};

using Sums = std::map<std::array<uint32_t, 2>, ColorSum>;  // by region and code

template <class Images>
Sums bake_regions(const ColorGrid& grid, const std::vector<FixedSurface>& surfaces,
                  const SampledLooks& looks, Images& images) {
  Sums sums;
  RegionBaker<Images> baker(grid, looks.materials, images, {}, &looks.cutouts);
  std::vector<ColoredCell> cells;
  const uint32_t level = grid.region_level();
  for (uint32_t region = 0; region < 1u << 3 * level; ++region) {
    Cube cube{level, {}};
    morton_decode(region, cube.position[0], cube.position[1], cube.position[2]);
    baker.bake(cube, surfaces, cells);
    for (const ColoredCell& cell : cells) sums[{region, cell.code}] = cell.sum;
  }
  return sums;
}

// The texture coordinates of the widest surfaces, and the cells of the coarsest grid, are too large
// for the kernels.
TEST(Samples, KernelsGiveTheColorsOfSingleCells) {
  const SampledLooks looks;
  uint64_t read_with = 0, read_without = 0;
  for (const SceneKind kind : oracle::kAllKinds)
    for (const ColorGrid grid : {ColorGrid{6, 6}, ColorGrid{10, 7}, ColorGrid{20, 5}})
      for (const int widest : {23, 26, 29, 40}) {
        SCOPED_TRACE(oracle::kind_name(kind) + " " + std::to_string(grid.levels) + " " +
                     std::to_string(widest));
        const auto surfaces = looks.scene(kind, grid, 20, int64_t{1} << widest);
        TiledImages tiled(looks.images, SampledLooks::kImages, true),
            untiled(looks.images, SampledLooks::kImages, false);
        EXPECT_EQ(bake_regions(grid, surfaces, looks, tiled),
                  bake_regions(grid, surfaces, looks, untiled));
        read_with += tiled.texels_read;
        read_without += untiled.texels_read;
      }
  EXPECT_GT(read_with, 0u);
  if (color::sample_kernels_avx2()) {
    EXPECT_LT(read_with, read_without / 4 * 3);
  }
}

}  // namespace
}  // namespace voxdag
