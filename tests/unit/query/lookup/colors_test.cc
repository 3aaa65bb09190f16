// Compares the colors of batches of cells, from C++ and from C, with a decoder that was written
// from docs/format.md.
#include <gtest/gtest.h>

#include "core/format/global/voxdag_reader.h"
#include "query/c/voxdag.h"
#include "tests/unit/core/format/color/valued_files.h"
#include "voxdag/query.h"

namespace voxdag::query {
namespace {

// A file with 2^9 voxels and 2^7 colored cells per edge, so that a cell is 4 voxels wide. The color
// grid has two tiers.
class Colors : public testing::Test {
 protected:
  void SetUp() override {
    scene_ = {9, 7, random_codes(11, 9, 3000), smooth_colors(7, 20)};
    write_colored(path_, scene_);
  }
  // Returns the set cells of a level, in Morton order.
  std::vector<Position> cells(uint32_t level) const {
    std::vector<Position> cells;
    for (const uint64_t code : scene_.cells(level)) {
      uint32_t x, y, z;
      morton_decode(code, x, y, z);
      cells.push_back({x, y, z});
    }
    return cells;
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("scene.vdag");
  ColoredScene scene_;
};

TEST_F(Colors, OfEveryCell) {
  const ByteString bytes = read_bytes(path_);
  const SectionDecoder decoder(bytes, scene_);
  const DagFile dag(path_);
  EXPECT_TRUE(dag.has_colors());
  EXPECT_EQ(dag.color_levels(), 7u);
  for (uint32_t level = 0; level <= scene_.levels; ++level) {
    SCOPED_TRACE(level);
    const Codes codes = scene_.cells(level);
    const std::vector<Position> points = cells(level);
    std::vector<Rgba> colors(points.size(), Rgba{1, 2, 3, 4}), by_three(colors);
    dag.colors(points, level, colors);
    dag.colors(points, level, by_three, 3);
    EXPECT_EQ(colors, by_three);
    for (size_t i = 0; i < codes.size(); ++i) {
      const uint32_t stored = std::min(level, 7u);
      const auto& expected = decoder.colors().at({stored, codes[i] >> 3 * (level - stored)});
      for (size_t c = 0; c < 3; ++c) ASSERT_EQ(colors[i][c], expected[c]) << i;
      ASSERT_EQ(colors[i][3], 255);
    }
  }
}

// A batch can have the cells in any order, and can contain empty cells and cells outside the grid.
TEST_F(Colors, InAnyOrder) {
  const DagFile dag(path_);
  std::vector<Position> points = cells(9);
  std::vector<Rgba> colors(points.size());
  dag.colors(points, 9, colors);
  std::map<Position, Rgba> of;
  for (size_t i = 0; i < points.size(); ++i) of[points[i]] = colors[i];
  oracle::Random random(5);
  for (int i = 0; i < 5000; ++i)
    points.push_back({random.between(-3, 515), random.between(-3, 515), random.between(-3, 515)});
  points.insert(points.end(), {{INT64_MIN, 0, 0}, {0, INT64_MAX, 0}, {0, 0, int64_t{1} << 32}});
  for (size_t i = points.size(); i-- > 1;)
    std::swap(points[i], points[static_cast<size_t>(random.between(0, static_cast<int>(i)))]);
  colors.assign(points.size(), Rgba{1, 2, 3, 4});
  dag.colors(points, 9, colors, 2);
  size_t unset = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto found = of.find(points[i]);
    unset += found == of.end();
    ASSERT_EQ(colors[i], found == of.end() ? Rgba{} : found->second) << i;
  }
  EXPECT_GT(unset, 1000u);
}

TEST_F(Colors, FromC) {
  const std::vector<Position> points = cells(8);
  std::vector<Rgba> expected(points.size()), colors(points.size());
  DagFile(path_).colors(points, 8, expected);
  voxdag_file* file = nullptr;
  ASSERT_EQ(voxdag_open(path_.c_str(), &file), VOXDAG_OK);
  voxdag_facts facts{};
  facts.struct_size = sizeof facts;
  ASSERT_EQ(voxdag_get_facts(file, &facts), VOXDAG_OK);
  EXPECT_EQ(facts.color_levels, 7u);
  EXPECT_EQ(facts.attributes, VOXDAG_HAS_COLORS);
  const auto cells = reinterpret_cast<const int64_t(*)[3]>(points.data());
  const auto rgba = reinterpret_cast<uint8_t(*)[4]>(colors.data());
  ASSERT_EQ(voxdag_colors(file, 8, cells, points.size(), rgba), VOXDAG_OK) << voxdag_error();
  EXPECT_EQ(colors, expected);
  EXPECT_EQ(voxdag_colors(file, 10, cells, 1, rgba), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_colors(file, 8, cells, 1, nullptr), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_colors(file, 8, nullptr, 1, rgba), VOXDAG_INVALID_INPUT);
  EXPECT_EQ(voxdag_colors(nullptr, 8, cells, 1, rgba), VOXDAG_INVALID_INPUT);
  voxdag_close(file);
}

// Compares alpha, normals and materials of cells of the color grid and of a cell that is not set.
TEST_F(Colors, OtherAttributes) {
  const std::string path = folder_.file("valued.vdag");
  write_valued(path, scene_, {Attribute::kAlpha, Attribute::kNormal, Attribute::kMaterial}, 5);
  const DagFile dag(path);
  EXPECT_FALSE(dag.has_colors());
  EXPECT_TRUE(dag.has_alphas() && dag.has_normals() && dag.has_materials());
  EXPECT_EQ(dag.color_levels(), 7u);
  EXPECT_EQ(dag.material_names(), names_of_materials(5));
  std::vector<Position> points = cells(7);
  const Codes codes = scene_.cells(7);
  points.push_back({-1, 0, 0});
  std::vector<uint8_t> alphas(points.size(), 9);
  std::vector<Normal> normals(points.size(), Normal{9, 9, 9});
  std::vector<uint32_t> materials(points.size(), 9);
  dag.alphas(points, 7, alphas);
  dag.normals(points, 7, normals, 2);
  dag.materials(points, 7, materials);
  for (size_t i = 0; i < codes.size(); ++i) {
    ASSERT_EQ(alphas[i], value_of_code(Attribute::kAlpha, codes[i], 5));
    ASSERT_EQ(materials[i], value_of_code(Attribute::kMaterial, codes[i], 5));
    const uint32_t normal = value_of_code(Attribute::kNormal, codes[i], 5);
    const unsigned char code[2] = {static_cast<unsigned char>(normal),
                                   static_cast<unsigned char>(normal >> 8)};
    const voxdag_reader::Normal expected = voxdag_reader::octahedral_normal(code);
    ASSERT_EQ(normals[i], (Normal{expected.x, expected.y, expected.z}));
  }
  EXPECT_EQ(alphas.back(), 0);
  EXPECT_EQ(normals.back(), Normal{});
  EXPECT_EQ(materials.back(), kNoMaterial);

  voxdag_file* file = nullptr;
  ASSERT_EQ(voxdag_open(path.c_str(), &file), VOXDAG_OK);
  voxdag_facts facts{};
  facts.struct_size = sizeof facts;
  ASSERT_EQ(voxdag_get_facts(file, &facts), VOXDAG_OK);
  EXPECT_EQ(facts.attributes, VOXDAG_HAS_ALPHAS | VOXDAG_HAS_NORMALS | VOXDAG_HAS_MATERIALS);
  EXPECT_EQ(facts.materials, 5u);
  EXPECT_STREQ(voxdag_material_name(file, 1), "m1");
  EXPECT_EQ(voxdag_material_name(file, 5), nullptr);
  const auto cells = reinterpret_cast<const int64_t(*)[3]>(points.data());
  std::vector<uint8_t> c_alphas(points.size());
  std::vector<Normal> c_normals(points.size());
  std::vector<uint32_t> c_materials(points.size());
  EXPECT_EQ(voxdag_alphas(file, 7, cells, points.size(), c_alphas.data()), VOXDAG_OK);
  EXPECT_EQ(voxdag_normals(file, 7, cells, points.size(),
                           reinterpret_cast<float(*)[3]>(c_normals.data())),
            VOXDAG_OK);
  EXPECT_EQ(voxdag_materials(file, 7, cells, points.size(), c_materials.data()), VOXDAG_OK);
  EXPECT_EQ(c_alphas, alphas);
  EXPECT_EQ(c_normals, normals);
  EXPECT_EQ(c_materials, materials);
  Rgba color;
  EXPECT_EQ(voxdag_colors(file, 7, cells, 1, reinterpret_cast<uint8_t(*)[4]>(&color)),
            VOXDAG_INVALID_INPUT);
  voxdag_close(file);
}

TEST_F(Colors, OfAFileWithoutColors) {
  const std::string plain = folder_.file("plain.vdag");
  write_colored(plain, scene_, false);
  const DagFile dag(plain);
  EXPECT_FALSE(dag.has_colors());
  const Position point{};
  Rgba color;
  try {
    dag.colors({&point, 1}, 9, {&color, 1});
    FAIL() << "it has found colors";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("with colors"), std::string::npos) << error.message();
  }
  std::vector<Rgba> too_many(2);
  EXPECT_THROW(DagFile(path_).colors({&point, 1}, 9, too_many), Error);
  EXPECT_THROW(DagFile(path_).colors({&point, 1}, 10, {&color, 1}), Error);
}

}  // namespace
}  // namespace voxdag::query
