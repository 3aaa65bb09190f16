// Compares the alpha, normals and materials of an extract with the input's values. Code written
// from docs/format.md decodes both.
#include "tests/unit/core/format/color/valued_files.h"
#include "tests/unit/query/extract/extract_fixture.h"

namespace voxdag::query {
namespace {

constexpr AttributeSet kValues{Attribute::kAlpha, Attribute::kNormal, Attribute::kMaterial};

class ExtractValues : public Extract {
 protected:
  void write(uint32_t levels, uint32_t color_levels, const AttributeSet& attributes = kValues) {
    scene_ = {levels, color_levels, random_codes(21, levels, 1500), smooth_colors(color_levels, 3)};
    write_valued(path("in.vdag"), scene_, attributes, 300);
  }

  static bool is_whole(const Selection& selection, uint32_t level, uint64_t code) {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    const int64_t edge = int64_t{1} << (selection.grid_levels - level);
    return selection.region.contains({x * edge, y * edge, z * edge}, edge);
  }

  // Extracts the selection. Compares the values of the finest cells, and of coarser cells that the
  // region does not cut, with the input's. The decoder checks that the values of other coarser
  // cells follow from their finer cells.
  void check(const Selection& selection, bool crop) {
    const Cube cube = crop ? crop_cube(selection) : Cube{};
    ColoredScene part;
    part.levels = selection.grid_levels - cube.level;
    const uint32_t finest = std::min(scene_.color_levels, selection.grid_levels);
    part.color_levels = std::max(finest, cube.level + 2) - cube.level;
    const uint64_t corner = morton_encode(cube.position[0], cube.position[1], cube.position[2]);
    for (const uint64_t code : scene_.cells(selection.grid_levels))
      if (is_whole(selection, selection.grid_levels, code))
        part.voxels.push_back(code - (corner << 3 * part.levels));
    extract_file("in.vdag", spec("out.vdag", selection, crop));
    EXPECT_EQ(attributes_of(*open_global_file(path("out.vdag"))),
              part.voxels.empty() ? AttributeSet{} : kValues);
    if (part.voxels.empty()) return;
    const std::string in_bytes = bytes("in.vdag"), out_bytes = bytes("out.vdag");
    for (size_t i = 0; i < 3; ++i) {
      const auto kind = static_cast<uint32_t>(i + 2);
      const uint64_t width = i == 0 ? 1 : 2;
      const ValueDecoder in(in_bytes, scene_, i, kind, width), out(out_bytes, part, i, kind, width);
      EXPECT_EQ(in.names(), out.names());
      for (const auto& [place, value] : out.values()) {
        const uint32_t level = place.first + cube.level;
        const uint64_t code = corner << 3 * place.first | place.second;
        const bool is_finest = place.first == part.color_levels;
        if (!is_finest && !is_whole(selection, level, code)) {
          ++cut_;
          continue;
        }
        const uint32_t up = level - std::min(level, scene_.color_levels);
        ASSERT_EQ(in.values().at({level - up, code >> 3 * up}), value) << level << " " << code;
        ++equal_;
      }
    }
  }

  ColoredScene scene_;
  size_t equal_ = 0, cut_ = 0;
};

TEST_F(ExtractValues, OfEverythingAreTheSameBytes) {
  for (const auto& [levels, color_levels] : {std::pair{9u, 9u}, {8u, 7u}, {6u, 2u}, {16u, 15u}}) {
    SCOPED_TRACE(testing::Message() << levels << ", " << color_levels);
    write(levels, color_levels, AttributeSet::all());
    extract_file("in.vdag", spec("out.vdag", {levels, whole_grid(levels)}));
    EXPECT_TRUE(bytes("out.vdag") == bytes("in.vdag"));
  }
}

TEST_F(ExtractValues, OfLevelsAndRegions) {
  write(9, 8);
  for (uint32_t level = 2; level <= 9; ++level) {
    SCOPED_TRACE(level);
    check({level, whole_grid(level)}, false);
  }
  EXPECT_EQ(cut_, 0u);
  EXPECT_GT(equal_, 1000u);
  oracle::Random random(4);
  for (int i = 0; i < 12; ++i) {
    const auto level = static_cast<uint32_t>(random.between(5, 9));
    const int64_t edge = int64_t{1} << level;
    Selection selection{level, {}};
    for (size_t a = 0; a < 3; ++a) {
      selection.region.low[a] = random.between(0, edge / 2);
      selection.region.high[a] = random.between(edge / 2, edge);
    }
    SCOPED_TRACE(i);
    check(selection, i % 2 == 1);
  }
  EXPECT_GT(cut_, 100u);
}

}  // namespace
}  // namespace voxdag::query
