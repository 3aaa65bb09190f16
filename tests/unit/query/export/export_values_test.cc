// PLY and npz files contain the alpha, the normal and the material of each cell, in the order of
// the cells.
#include <gtest/gtest.h>

#include <cstring>

#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "tests/unit/core/format/color/valued_files.h"

namespace voxdag::query {
namespace {

class ExportValues : public testing::Test {
 protected:
  void write(const AttributeSet& attributes) {
    write_valued(folder_.file("a.vdag"), {6, 5, random_codes(7, 6, 300), smooth_colors(5, 3)},
                 attributes, 300);
    file_ = open_global_file(folder_.file("a.vdag"));
  }
  std::string exported(const char* format, uint32_t level) {
    const std::string output = folder_.file("out");
    NoProgress progress;
    export_dag(system_files(), *file_,
               {&export_format(format),
                {level, whole_grid(level)},
                output,
                uint64_t{64} << 20,
                false,
                true},
               progress, CancelToken{});
    return read_bytes(output);
  }
  // Values of a cell according to the reader.
  struct Cell {
    uint8_t alpha;
    voxdag_reader::Normal normal;
    uint32_t material;
  };
  std::vector<Cell> cells_of(uint32_t level) const {
    std::vector<Cell> cells;
    for (uint64_t code = 0; code < uint64_t{1} << 3 * level; ++code) {
      uint32_t x, y, z;
      morton_decode(code, x, y, z);
      const auto alpha = file_->alpha(x, y, z, level);
      if (alpha)
        cells.push_back({*alpha, *file_->normal(x, y, z, level), *file_->material(x, y, z, level)});
    }
    return cells;
  }

  TemporaryFolder folder_;
  std::unique_ptr<voxdag_reader::File> file_;
};

TEST_F(ExportValues, ToPly) {
  write(AttributeSet::all().without(Attribute::kColor));
  for (const uint32_t level : {6u, 4u}) {
    const std::string bytes = exported("ply", level);
    const size_t header = bytes.find("end_header\n") + 11;
    EXPECT_NE(
        bytes.find("property double z\nproperty uchar alpha\nproperty float nx\nproperty float "
                   "ny\nproperty float nz\nproperty uint material\nend_header"),
        std::string::npos);
    const auto cells = cells_of(level);
    ASSERT_GT(cells.size(), 50u);
    ASSERT_EQ(bytes.size() - header, cells.size() * (24 + 1 + 12 + 4));
    for (size_t i = 0; i < cells.size(); ++i) {
      const char* const at = bytes.data() + header + i * 41 + 24;
      EXPECT_EQ(static_cast<uint8_t>(at[0]), cells[i].alpha);
      EXPECT_EQ(std::memcmp(at + 1, &cells[i].normal, 12), 0);
      EXPECT_EQ(std::memcmp(at + 13, &cells[i].material, 4), 0);
    }
  }
}

TEST_F(ExportValues, ToNpz) {
  write(AttributeSet::all());
  const std::string bytes = exported("npz", 5);
  std::string alphas, normals, materials;
  for (const Cell& cell : cells_of(5)) {
    alphas += static_cast<char>(cell.alpha);
    normals.append(reinterpret_cast<const char*>(&cell.normal), 12);
    materials.append(reinterpret_cast<const char*>(&cell.material), 4);
  }
  for (const char* name : {"colors.npy", "alphas.npy", "normals.npy", "materials.npy"})
    EXPECT_NE(bytes.find(name), std::string::npos) << name;
  for (const std::string& column : {alphas, normals, materials})
    EXPECT_NE(bytes.find(column), std::string::npos);
}

}  // namespace
}  // namespace voxdag::query
