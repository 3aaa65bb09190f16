// Tests the sections of alpha, normals and materials. In every cell of every level, the reader's
// value equals the value of a decoder written from docs/format.md. In the finest cells, this is the
// original value. In coarser cells, it follows from the children's values by the attribute's rule
// (docs/color.md).
#include <gmock/gmock.h>

#include <cmath>

#include "core/color/normal_code.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "tests/unit/core/format/color/valued_files.h"

namespace voxdag {
namespace {

using testing::HasSubstr;

constexpr AttributeSet kAll = AttributeSet::all();
constexpr AttributeSet kValues = kAll.without(Attribute::kColor);

class ValueSectionTest : public testing::Test {
 protected:
  static void verify(const std::string& path, uint64_t narrow_words = uint64_t{1} << 32) {
    MemoryBudget budget(uint64_t{1} << 30);
    NoProgress progress;
    verify_global_file(*open_global_file(path), 2, budget, progress, {}, narrow_words);
  }

  // Returns the value that the reader finds in a cell, as the number that the file stores; nullopt
  // if the cell is not set.
  static std::optional<uint32_t> value_in(const voxdag_reader::File& file, Attribute attribute,
                                          const uint32_t (&at)[3], uint32_t level) {
    uint64_t i;
    voxdag_reader::ColorCursor cursor(file, section_of(file, attribute));
    const auto* const region = cursor.find(at[0], at[1], at[2], level, i);
    return region ? std::optional(region->value(i)) : std::nullopt;
  }

  void check(const ColoredScene& scene, const AttributeSet& attributes, size_t materials,
             uint64_t narrow_words = uint64_t{1} << 32) {
    write_valued(path_, scene, attributes, materials, narrow_words);
    const auto file = open_global_file(path_);
    EXPECT_EQ(file->version(), 2u);
    EXPECT_EQ(attributes_of(*file), attributes);
    EXPECT_NO_THROW(verify(path_, narrow_words));
    const ByteString bytes = read_bytes(path_);
    size_t index = 0;
    for (const Attribute attribute : attributes.list()) {
      if (attribute == Attribute::kColor) {
        ++index;
        continue;
      }
      SCOPED_TRACE(name_of(attribute));
      const ValueDecoder decoder(bytes, scene, index++, static_cast<uint32_t>(attribute),
                                 value_bytes(attribute, materials));
      std::map<uint64_t, uint32_t> values;
      for (const uint64_t code : scene.cells(scene.color_levels))
        values[code] = value_of_code(attribute, code, materials);
      for (uint32_t level = scene.color_levels;; --level) {
        std::map<uint64_t, std::vector<uint32_t>> children;
        for (const auto& [code, value] : values) {
          uint32_t at[3];
          morton_decode(code, at[0], at[1], at[2]);
          const auto stored = decoder.values().find({level, code});
          ASSERT_NE(stored, decoder.values().end());
          ASSERT_EQ(stored->second, value) << "level " << level << ", cell " << code;
          ASSERT_EQ(value_in(*file, attribute, at, level), value);
          children[code >> 3].push_back(value);
        }
        if (level == 0) break;
        values.clear();
        for (const auto& [code, of_cell] : children)
          values[code] = traits_of(attribute).value_of_parent(of_cell);
      }
      if (attribute != Attribute::kMaterial) continue;
      EXPECT_EQ(decoder.names(), names_of_materials(materials));
      EXPECT_EQ(file->material_names(), decoder.names());
    }
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("valued.vdag");
};

TEST_F(ValueSectionTest, HaveTheValuesOfAllLevels) {
  const uint32_t sizes[][2] = {{2, 2}, {4, 3},   {6, 6},   {7, 7},
                               {9, 8}, {13, 12}, {15, 14}, {20, 17}};
  for (const auto& [levels, color_levels] : sizes) {
    SCOPED_TRACE(std::to_string(levels) + ", cells " + std::to_string(color_levels));
    check({levels, color_levels, random_codes(levels, levels, levels < 4 ? 20 : 600),
           smooth_colors(color_levels, 3)},
          kAll, 3);
  }
}

TEST_F(ValueSectionTest, MaterialsAreAsWideAsTheyMustBe) {
  const ColoredScene scene{8, 8, random_codes(3, 8, 400), smooth_colors(8, 3)};
  const AttributeSet materials{Attribute::kMaterial};
  for (const size_t count : {1u, 256u, 257u, 65536u, 65537u}) check(scene, materials, count);
}

// A file can have any set of attributes, with and without wide levels (levels to which pointers
// have 64 bits).
TEST_F(ValueSectionTest, AreIndependent) {
  const ColoredScene scene{7, 6, random_codes(4, 7, 300), smooth_colors(6, 4)};
  for (int bits = 1; bits < 16; ++bits) {
    AttributeSet set;
    for (const AttributeTraits& row : kAttributeTable)
      if (bits >> (static_cast<uint32_t>(row.attribute) - 1) & 1) set.add(row.attribute);
    SCOPED_TRACE(bits);
    check(scene, set, 7, bits % 2 ? 50 : uint64_t{1} << 32);
  }
  // A file whose only attribute is color has the same bytes as before other attributes existed.
  write_colored(folder_.file("colored.vdag"), scene);
  write_valued(path_, scene, {Attribute::kColor});
  EXPECT_EQ(read_bytes(path_), read_bytes(folder_.file("colored.vdag")));
}

// Every version of voxdag must write the same bytes for these sections.
TEST_F(ValueSectionTest, HaveTheBytesThatTheyAlwaysHad) {
  const ColoredScene scene{4, 3, random_codes(1, 4, 40), smooth_colors(3, 4)};
  const auto digest = [&](const AttributeSet& set) {
    return write_valued(path_, scene, set, 3).sha256;
  };
  EXPECT_EQ(digest({Attribute::kAlpha}),
            "5ed227ce23ed95da04e472e244d76891b157cfc280e0921a14d2f1d4adc4f1a2");
  EXPECT_EQ(digest({Attribute::kNormal}),
            "9d6bd3ca92cb481048dd849ca1cce46ee28cbb9c6bf484d57c1bf1c3ea2431c7");
  EXPECT_EQ(digest({Attribute::kMaterial}),
            "328cc70b5cae7b77fee21e8d32c6dbf55d839d14bde1021101e85f70979887b5");
  EXPECT_EQ(digest(kAll), "1098b061302d88df97fe77106b8abf11aa1695a20567374cd7f4ab64bc936a8c");
}

TEST_F(ValueSectionTest, ReaderHasAllOfThem) {
  const ColoredScene scene{5, 4, random_codes(1, 5, 100), smooth_colors(4, 4)};
  write_valued(path_, scene, kValues, 3);
  const voxdag_reader::File file(path_);
  EXPECT_FALSE(file.has_colors());
  EXPECT_EQ(file.normals().color_levels(), 4u);
  for (const uint64_t code : scene.cells(4)) {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    EXPECT_EQ(file.alpha(x, y, z, 4), value_of_code(Attribute::kAlpha, code, 3));
    EXPECT_EQ(file.material(x, y, z, 4), value_of_code(Attribute::kMaterial, code, 3));
    const auto normal = file.normal(x, y, z, 4);
    ASSERT_TRUE(normal);
    const auto direction =
        decode_normal(static_cast<NormalCode>(value_of_code(Attribute::kNormal, code, 3)));
    EXPECT_NEAR(normal->x, static_cast<double>(direction[0]) / 16384, 1e-4);
    EXPECT_NEAR(normal->y, static_cast<double>(direction[1]) / 16384, 1e-4);
    EXPECT_NEAR(normal->z, static_cast<double>(direction[2]) / 16384, 1e-4);
  }
  uint64_t next = 0;  // a cell that is not set
  for (const uint64_t code : scene.cells(4)) next += code == next;
  uint32_t x, y, z;
  morton_decode(next, x, y, z);
  EXPECT_FALSE(file.alpha(x, y, z, 4) || file.normal(x, y, z, 4) || file.material(x, y, z, 4));
  EXPECT_FALSE(file.color(0, 0, 0, 0));
  write_colored(path_, scene);
  const voxdag_reader::File colored(path_);
  EXPECT_FALSE(colored.alpha(0, 0, 0, 0) || colored.normal(0, 0, 0, 0) ||
               colored.material(0, 0, 0, 0));
  EXPECT_TRUE(colored.material_names().empty());
}

// Every byte of the sections is changed, with corrected checksums. The reader never accesses memory
// outside the file (the address sanitizer checks this). `verify` finds all changes, except changes
// that are valid: another value of a finest cell, or another name of a material.
TEST_F(ValueSectionTest, DamageIsAnError) {
  const ColoredScene scene{3, 3, random_codes(2, 3, 60), smooth_colors(3, 60)};
  write_valued(path_, scene, kValues, 3);
  const ByteString good = read_bytes(path_);
  uint64_t section, table;
  std::memcpy(&section, good.data() + 1152 + 8, 8);
  std::memcpy(&table, good.data() + 96, 8);
  const std::string changed = folder_.file("changed.vdag");
  const size_t finest = scene.cells(3).size();
  size_t found = 0, accepted = 0;
  for (uint64_t at = section; at < table; at += at % 4096 < 700 ? 3 : 397) {
    ByteString bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 1 << at % 8);
    put_checksums_right(bad);
    write_bytes(changed, bad);
    try {
      verify(changed);
      ++accepted;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << at;
      ++found;
    }
    try {
      const voxdag_reader::File file(changed);
      for (uint32_t level = 0; level <= 3; ++level)
        for (int cell = 0; cell < 1 << 3 * level; ++cell) {
          const int x = cell >> 2 * level, y = cell >> level & ((1 << level) - 1),
                    z = cell & ((1 << level) - 1);
          file.alpha(x, y, z, level);
          file.normal(x, y, z, level);
          file.material(x, y, z, level);
        }
    } catch (const voxdag_reader::Error&) {
    }
  }
  // `verify` can accept changes in the bytes of the finest cells (alpha has 1 byte per cell, the
  // normal 2 and the material 1) and in the 6 bytes of names.
  EXPECT_LE(accepted, (4 * finest + 6) / 3 + 3);
  EXPECT_GT(found, 100u);
}

// A file is refused if an entry of its attribute table does not match the sections or the DAG.
TEST_F(ValueSectionTest, SectionsThatDoNotFitAreRefused) {
  const ColoredScene scene{3, 3, random_codes(2, 3, 60), smooth_colors(3, 60)};
  write_valued(path_, scene, kValues, 3);
  const ByteString good = read_bytes(path_);
  const std::string changed = folder_.file("changed.vdag");
  const auto refusal = [&](size_t at, auto value) {
    ByteString bad = good;
    std::memcpy(bad.data() + at, &value, sizeof value);
    const uint64_t header = checksum64(std::as_bytes(std::span(bad)).first(4088));
    std::memcpy(bad.data() + 4088, &header, 8);
    write_bytes(changed, bad);
    return error_of([&] { verify(changed); }).message();
  };
  EXPECT_THAT(refusal(1152 + 40, uint32_t{64}), HasSubstr("its blocks do not have the size"));
  EXPECT_THAT(refusal(1152 + 128 + 40, uint32_t{16}), HasSubstr("its blocks do not have the size"));
  EXPECT_THAT(refusal(1152 + 128 + 40, uint32_t{96}), HasSubstr("its blocks do not have the size"));
  EXPECT_THAT(refusal(1152 + 128 + 40, uint32_t{64}), HasSubstr("header: "));
  EXPECT_THAT(refusal(1152 + 64 + 24, uint64_t{1}), HasSubstr("1 normals, the section has"));
  EXPECT_THAT(refusal(1152 + 128 + 32, uint64_t{1}), HasSubstr("materials, the section has"));
  EXPECT_THAT(refusal(1152 + 128, uint32_t{5}), HasSubstr("3 attribute sections, expected"));
  EXPECT_THAT(refusal(1152 + 64, uint32_t{2}),
              HasSubstr("attribute section 1: kind 2, expected over 2"));
  EXPECT_THAT(refusal(1152 + 64 + 50, uint8_t{1}), HasSubstr("reserved"));
}

TEST_F(ValueSectionTest, RegionsMustFitTheAttribute) {
  const ColoredScene scene{8, 8, random_codes(6, 8, 500), smooth_colors(8, 4)};
  const auto add = [&](std::vector<EncodedRegion> some) {
    GlobalFileWriter writer(system_files(), path_, Grid::given({0, 0, 0}, 1, 8), 64);
    write_levels(writer, sparse_dag(scene.voxels, 8), 8);
    MemoryBudget budget(uint64_t{1} << 28);
    AttributeSectionWriter section(writer, Attribute::kNormal, 8, {}, budget);
    for (const EncodedRegion& region : some) section.add_region(region);
    section.finish();
  };
  const auto normals = encode_values_of(scene, Attribute::kNormal, 1);
  EXPECT_NO_THROW(add(normals));
  EXPECT_THAT(error_of([&] { add({}); }).message(),
              HasSubstr("the section of normal has no regions"));
  EXPECT_THAT(error_of([&] { add(encode_values_of(scene, Attribute::kAlpha, 1)); }).message(),
              HasSubstr("bytes of blocks"));
  EXPECT_THAT(error_of([&] {
                add({normals[1], normals[0]});
              }).message(),
              HasSubstr("above the previous region's, "));
}

}  // namespace
}  // namespace voxdag
