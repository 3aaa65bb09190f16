// Compares the colors and other values of combined files with values that are computed voxel by
// voxel from the scenes.
#include "query/attributes/stored_section.h"
#include "tests/support/error_of.h"
#include "tests/unit/query/combine/combine_colors_fixture.h"

namespace voxdag::query {
namespace {

TEST_F(CombineColors, AllOperations) {
  for (const auto& [levels, color_a, color_b] :
       {std::array{6u, 6u, 6u}, {7u, 5u, 5u}, {6u, 4u, 6u}, {7u, 7u, 3u}, {8u, 8u, 8u}}) {
    write(levels, color_a, levels, color_b, 700);
    const uint32_t finer = std::max(color_a, color_b);
    check(spec(Operation::kUnion, "c"), finer);
    check(spec(Operation::kXor, "c"), finer);
    check(spec(Operation::kMinus, "c"), color_a);
    check(spec(Operation::kAnd, "c"), color_a);
  }
  EXPECT_GT(from_a_, 1000u);
  EXPECT_GT(from_b_, 1000u);
}

// The moved file has another resolution. Tests offsets with which its cells align with the cells of
// the result, and other offsets.
TEST_F(CombineColors, Offset) {
  for (const auto& [color_a, levels_b, color_b] :
       {std::array{6u, 6u, 6u}, {6u, 5u, 3u}, {3u, 6u, 4u}, {4u, 7u, 2u}, {2u, 8u, 3u}}) {
    SCOPED_TRACE(testing::Message() << color_a << " " << levels_b << " " << color_b);
    write(6, color_a, levels_b, color_b, 300);
    const int of_b = static_cast<int>(color_b) + 6 - static_cast<int>(levels_b);
    const auto finer = static_cast<uint32_t>(std::max({static_cast<int>(color_a), of_b, 2}));
    for (const Position& offset : {Position{8, -16, 0}, {1, 2, 3}, {-5, 7, 10}}) {
      CombineSpec moved = spec(Operation::kUnion, "c");
      moved.offset = offset;
      moved.clip = true;
      check(moved, finer);
      moved.operation = Operation::kXor;
      check(moved, finer);
    }
  }
  EXPECT_GT(from_b_, 500u);
}

// Only b has colors, and it is moved. A cell of the result can overlap a cube of b whose voxels are
// all in other cells of the result. Such a cell has the fill color.
TEST_F(CombineColors, OffsetAndFill) {
  for (const auto& [levels_b, color_b] : {std::pair{6u, 4u}, {5u, 3u}, {7u, 6u}, {8u, 5u}}) {
    SCOPED_TRACE(testing::Message() << levels_b << " " << color_b);
    write(6, 6, levels_b, color_b, 300);
    write_file(0, false);
    CombineSpec moved = spec(Operation::kUnion, "c");
    moved.fill_color = voxdag_reader::Rgb{0, 0, 0};
    moved.clip = true;
    for (const Position& offset : {Position{4, -8, 0}, {2, 0, 0}, {1, 2, 3}, {-5, 7, 10}}) {
      moved.offset = offset;
      for (const Operation operation : {Operation::kUnion, Operation::kXor}) {
        moved.operation = operation;
        check(moved, color_b + 6 - levels_b, {false, true}, 0);
      }
    }
  }
  EXPECT_GT(from_b_, 500u);
  EXPECT_GT(filled_, 500u);

  // Each file has one voxel.
  scenes_[0] = {6, 6, {code_of({7, 0, 0})}, grays(0)};
  scenes_[1] = {6, 4, {code_of({0, 0, 0})}, grays(1)};
  write_file(0, false);
  write_file(1, true);
  CombineSpec moved = spec(Operation::kUnion, "c");
  moved.fill_color = voxdag_reader::Rgb{0, 0, 0};
  moved.offset = Position{2, 0, 0};
  from_b_ = filled_ = 0;
  check(moved, 4, {false, true}, 0);
  EXPECT_EQ(from_b_, 1u);
  EXPECT_EQ(filled_, 1u);
}

// If the result has exactly the cells of one input, it has the bytes of this input. The color
// sections have up to three tiers (docs/format.md).
TEST_F(CombineColors, EqualVoxelsAreTheSameBytes) {
  for (const auto& [levels, color_levels] : {std::pair{9u, 9u}, {8u, 7u}, {16u, 15u}}) {
    SCOPED_TRACE(levels);
    write(levels, color_levels, levels, color_levels, 2000);
    const std::string a = bytes("a");
    EXPECT_TRUE(combined("a", Operation::kUnion, "a", "c") == a);
    EXPECT_TRUE(combined("a", Operation::kAnd, "a", "c") == a);
    EXPECT_EQ(combine_files("b", "b", spec(Operation::kXor, "none")).voxels, 0u);
    EXPECT_TRUE(combined("none", Operation::kUnion, "a", "c") == a);
    EXPECT_TRUE(combined("a", Operation::kXor, "none", "c") == a);
    EXPECT_TRUE(combined("a", Operation::kMinus, "none", "c") == a);
    const auto file = open_global_file(path("a"));
    const Shape nothing("box:0,0,0,1,1,1");
    ASSERT_NE(scenes_[0].voxels[0], 0u);
    cut(*file, nothing, spec(Operation::kMinus, "c"), system_files(), warnings_, never_);
    EXPECT_TRUE(bytes("c") == a);
  }
}

// Regions that the operation does not change keep their bytes; the other regions are encoded again.
TEST_F(CombineColors, UnchangedRegionsAreCopied) {
  scenes_[0] = {9, 9, random_codes(31, 9, 6000), smooth_colors(9, 20)};
  write_file(0, true);
  const std::string a = bytes("a");
  const auto file = open_global_file(path("a"));
  cut(*file, Shape("box:3,3,3,250,130,512"), spec(Operation::kMinus, "c"), system_files(),
      warnings_, never_);
  ColoredScene rest = scenes_[0];
  std::erase_if(rest.voxels, [](uint64_t code) {
    const Position at = position_of(code);
    return at[0] >= 3 && at[0] < 250 && at[1] >= 3 && at[1] < 130 && at[2] >= 3 && at[2] < 512;
  });
  ASSERT_LT(rest.voxels.size(), scenes_[0].voxels.size());
  const std::string c = bytes("c");
  const SectionDecoder before(a, scenes_[0]), after(c, rest);
  size_t equal = 0, near = 0;
  for (const auto& [place, color] : after.colors()) {
    const auto& old = before.colors().at(place);
    const Position region = position_of(place.second >> 3 * (std::max(place.first, 3u) - 3));
    if (place.first >= 3 && (region[0] >= 4 || region[1] >= 3)) {
      ASSERT_EQ(color, old);
      ++equal;
    } else if (place.first == 9) {
      for (size_t i = 0; i < 3; ++i) ASSERT_NEAR(color[i], old[i], kTolerance);
      ++near;
    }
  }
  EXPECT_GT(equal, 1000u);
  EXPECT_GT(near, 50u);
}

TEST_F(CombineColors, OneFileHasColors) {
  write(6, 6, 6, 5);
  CombineSpec filled = spec(Operation::kUnion, "c");
  filled.fill_color = voxdag_reader::Rgb{255, 255, 255};
  write_file(1, false);
  check(filled, 6, {true, false}, 255);
  const auto message = [&](const std::string& a, const std::string& b, Operation operation) {
    const auto file_a = open_global_file(path(a)), file_b = open_global_file(path(b));
    const Error error = error_of([&] {
      combine(*file_a, *file_b, spec(operation, "x"), system_files(), warnings_, never_);
    });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    return error.message();
  };
  const std::string expected =
      path("a") + " has colors and " + path("b") +
      " has none: expected colors in both files, --fill-color with a color for " + path("b") +
      ", or --no-attributes to combine only the voxels";
  EXPECT_EQ(message("a", "b", Operation::kUnion), expected);
  EXPECT_EQ(message("b", "a", Operation::kXor), expected);
  EXPECT_FALSE(std::filesystem::exists(path("x")));
  // These two operations need only the colors of a.
  check(spec(Operation::kMinus, "c"), 6, {true, false});
  check(spec(Operation::kAnd, "c"), 6, {true, false});
  write_file(0, false);
  const std::string voxels = combined("a", Operation::kUnion, "b", "c");
  write_file(1, true);
  filled.operation = Operation::kXor;
  check(filled, 5, {false, true}, 255);
  check(spec(Operation::kAnd, "c"), 5, {false, true});
  combine_files("a", "b", spec(Operation::kMinus, "c"));
  EXPECT_FALSE(open_global_file(path("c"))->has_colors());
  CombineSpec plain = spec(Operation::kUnion, "c");
  plain.attributes = false;
  combine_files("a", "b", plain);
  EXPECT_TRUE(bytes("c") == voxels);
}

TEST_F(CombineColors, MemoryAndThreadsDoNotMatter) {
  write(9, 9, 9, 9, 3000);
  CombineSpec one = spec(Operation::kXor, "one"), many = spec(Operation::kXor, "many");
  one.list_bytes = 256;
  many.threads = 5;
  many.memory_bytes = uint64_t{1} << 30;
  combine_files("a", "b", one);
  combine_files("a", "b", many);
  EXPECT_TRUE(bytes("one") == bytes("many"));
}

// Where a has a voxel, alpha, normals and materials have the values of a. Elsewhere they have the
// values of b.
TEST_F(CombineColors, OtherAttributes) {
  constexpr size_t kMaterials[2] = {7, 300};
  for (const auto& [color_a, color_b] : {std::pair{8u, 8u}, {7u, 6u}}) {
    write(8, color_a, 8, color_b);
    for (size_t f = 0; f < 2; ++f)
      write_valued(path(name(f)), scenes_[f], AttributeSet::all(), kMaterials[f]);
    for (const Operation operation : kAllOperations) {
      const CombineSpec combined = spec(operation, "c");
      const bool is_joined = operation == Operation::kUnion || operation == Operation::kXor;
      const ColoredScene result{
          8, is_joined ? std::max(color_a, color_b) : color_a, result_voxels(combined), {}};
      combine_files("a", "b", combined);
      std::set<uint64_t> cells_of_a;
      for (const uint64_t code : scenes_[0].cells(result.color_levels)) cells_of_a.insert(code);
      const std::string written = bytes("c");
      for (size_t i = 0; i < 3; ++i) {
        const auto kind = static_cast<uint32_t>(i + 2);
        const auto attribute = static_cast<Attribute>(kind);
        // The joined list has 300 names, because all names of a are also names of b.
        const uint64_t width = i == 0 || (i == 2 && !is_joined) ? 1 : 2;
        const ValueDecoder decoder(written, result, i + 1, kind, width);
        if (i == 2) {
          EXPECT_EQ(decoder.names().size(), is_joined ? kMaterials[1] : kMaterials[0]);
        }
        for (const uint64_t code : result.cells(result.color_levels)) {
          const size_t from = cells_of_a.contains(code) ? 0 : 1;
          const uint32_t up = result.color_levels - scenes_[from].color_levels;
          const uint64_t expected = value_of_code(attribute, code >> 3 * up, kMaterials[from]);
          const uint64_t found = decoder.values().at({result.color_levels, code});
          if (i < 2) {
            ASSERT_EQ(found, expected);
          } else {
            ASSERT_EQ(decoder.names()[found], names_of_materials(kMaterials[from])[expected]);
          }
        }
      }
    }
  }
  write_valued(path("a"), scenes_[0], {Attribute::kColor, Attribute::kNormal});
  const auto file_a = open_global_file(path("a")), file_b = open_global_file(path("b"));
  const Error error = error_of([&] {
    combine(*file_a, *file_b, spec(Operation::kUnion, "x"), system_files(), warnings_, never_);
  });
  EXPECT_EQ(error.message(), path("b") + " has alphas and " + path("a") +
                                 " has none: expected alphas in both files, or --no-attributes to "
                                 "combine only the voxels");
}

// A cancel also ends the command while it completes a temporary file: the moved file, or the levels
// of the result. No file remains.
TEST_F(CombineColors, CancelWhileATemporaryFileIsCompleted) {
  class CancelAfterMerge : public NoProgress {
   public:
    void begin_stage(std::string_view stage, uint64_t, std::string_view) override {
      stages.emplace_back(stage);
    }
    void end_stage() override {
      if (stages.back() == "merge") cancel.cancel();
    }
    CancelToken cancel;
    std::vector<std::string> stages;
  };
  write(6, 6, 6, 6);
  const auto file_a = open_global_file(path("a")), file_b = open_global_file(path("b"));
  for (const bool is_moved : {false, true}) {
    CombineSpec canceled = spec(Operation::kUnion, "c");
    if (is_moved) canceled.offset = Position{};
    CancelAfterMerge progress;
    const Error error = error_of(
        [&] { combine(*file_a, *file_b, canceled, system_files(), progress, progress.cancel); });
    EXPECT_EQ(error.code(), ErrorCode::kCanceled);
    EXPECT_EQ(progress.stages.back(), "merge");
    expect_files({"a", "b"});
  }
}

TEST_F(CombineColors, CancelWhileTheIndexIsChecked) {
  write(6, 6, 6, 6);
  const auto file = open_global_file(path("a"));
  MemoryBudget budget(uint64_t{1} << 30);
  StoredSection section(*file, Attribute::kColor, system_files(), budget);
  section.check_index(6, never_);
  CancelToken canceled;
  canceled.cancel();
  EXPECT_EQ(error_of([&] { section.check_index(6, canceled); }).code(), ErrorCode::kCanceled);
}

// Damage in the colors of either file, and in their directory, is found. No file remains.
TEST_F(CombineColors, DamageIsFound) {
  write(8, 8, 8, 8);
  for (const char* const damaged_file : {"a", "b"}) {
    const std::string intact = bytes(damaged_file);
    std::vector<uint64_t> places;
    {
      const auto file = open_global_file(path(damaged_file));
      const auto& tier = file->colors().tier(0);
      places = {static_cast<uint64_t>(tier.data - file->data()) + 8 * tier.units,
                static_cast<uint64_t>(tier.directory - file->data()) + 40};
    }
    for (const uint64_t place : places) {
      std::string damaged = intact;
      damaged[place] = static_cast<char>(damaged[place] ^ 4);
      write_bytes(path(damaged_file), damaged);
      const auto file_a = open_global_file(path("a")), file_b = open_global_file(path("b"));
      const Error error = error_of([&] {
        combine(*file_a, *file_b, spec(Operation::kUnion, "c"), system_files(), warnings_, never_);
      });
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      EXPECT_NE(error.message().find(path(damaged_file)), std::string::npos) << error.message();
      expect_files({"a", "b"});
    }
    write_bytes(path(damaged_file), intact);
  }
}

}  // namespace
}  // namespace voxdag::query
