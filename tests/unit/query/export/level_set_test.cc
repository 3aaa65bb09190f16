// The distances of level sets (--grid sdf) equal distances that are computed cell by cell.
#include <gtest/gtest.h>

#include <algorithm>
#include <climits>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "query/export/level_set/narrow_band.h"
#include "tests/support/error_of.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/query/export/stages.h"

namespace voxdag::query {
namespace {

// Returns the voxels of a grid of 2^levels per edge for which is_set(x, y, z) is true.
template <class IsSet>
oracle::Voxels voxels_where(int levels, const IsSet& is_set) {
  oracle::Voxels voxels(1 << levels);
  for (int x = 0; x < voxels.edge(); ++x)
    for (int y = 0; y < voxels.edge(); ++y)
      for (int z = 0; z < voxels.edge(); ++z)
        if (is_set(x, y, z)) voxels.set(x, y, z);
  return voxels;
}

// Returns a ball with a hollow, a plate, scattered voxels, and a box at the border of the grid.
oracle::Voxels solid() {
  const oracle::Voxels noise = random_voxels(9, 32);
  return voxels_where(5, [&](int x, int y, int z) {
    const int square = (x - 11) * (x - 11) + (y - 12) * (y - 12) + (z - 13) * (z - 13);
    return (square < 100 && square > 8) || (x == 25 && y > 4 && z > 3) ||
           (x > 27 && y < 6 && z < 6 && noise.at(x, y, z)) || (x > 20 && y > 20 && z > 18);
  });
}

class LevelSetTest : public testing::Test {
 protected:
  void write(const oracle::Voxels& voxels) {
    write_global(folder_.file("a.vdag"), voxels);
    file_ = open_global_file(folder_.file("a.vdag"));
    dag_.emplace(*file_);
  }
  // Stores a number for each cell of a box. The number is `otherwise` for cells that are not set
  // yet and for cells outside the box.
  class Cells {
   public:
    Cells(const Region& box, int otherwise)
        : box_(box), side_(box.high[0] - box.low[0] + 1), otherwise_(otherwise) {
      for (size_t a = 1; a < 3; ++a) side_ = std::max(side_, box.high[a] - box.low[a] + 1);
      numbers_.assign(static_cast<size_t>(side_ * side_ * side_), otherwise);
    }
    int at(const Position& cell) const {
      return box_.contains(cell, 1) ? numbers_[index(cell)] : otherwise_;
    }
    // Returns false if the cell was set before.
    bool set(const Position& cell, int number) {
      if (!box_.contains(cell, 1)) return true;
      int& known = numbers_[index(cell)];
      const bool is_new = known == otherwise_;
      known = number;
      return is_new;
    }
    template <class Visit>
    void for_each(const Visit& visit) const {
      Position p;
      for (p[0] = box_.low[0]; p[0] < box_.high[0]; ++p[0])
        for (p[1] = box_.low[1]; p[1] < box_.high[1]; ++p[1])
          for (p[2] = box_.low[2]; p[2] < box_.high[2]; ++p[2]) visit(p, at(p));
    }

   private:
    size_t index(const Position& p) const {
      return static_cast<size_t>(((p[0] - box_.low[0]) * side_ + p[1] - box_.low[1]) * side_ +
                                 p[2] - box_.low[2]);
    }
    Region box_;
    int64_t side_;
    int otherwise_;
    std::vector<int> numbers_;
  };

  // Returns (2 distance)^2 of all visited cells in the domain of the level set; INT_MAX for cells
  // that are not visited. Checks that each cell is visited once.
  Cells visited(const Selection& selection, int width) const {
    Cells squares(band_domain(selection, width), INT_MAX);
    uint64_t repeated = 0;
    for_each_band_part(
        *dag_, selection, width,
        [&](const Position& low, const Position& at, BandTile& tile) {
          BandSquares out;
          tile.distances(at, out);
          for (int i = 0; i < 512; ++i)
            repeated += !squares.set({low[0] + i / 64, low[1] + i / 8 % 8, low[2] + i % 8},
                                     out[static_cast<size_t>(i)]);
          return true;
        },
        [&](const Position& low, int64_t edge) {
          Cells({low, {low[0] + edge, low[1] + edge, low[2] + edge}}, 0)
              .for_each([&](const Position& cell, int) {
                repeated += !squares.set(cell, -4 * width * width);
              });
          return true;
        });
    EXPECT_EQ(repeated, 0u);
    return squares;
  }
  // Compares the numbers of visited() with (2 distance)^2 to the nearest cell of the other kind,
  // set or empty, which is found by trying all cells nearby.
  void expect_right(const Selection& selection, int width) const {
    const int64_t w = width;
    Cells kinds(whole_grid(selection.grid_levels), 0);
    for_each_brick(*dag_, {selection.grid_levels, whole_grid(selection.grid_levels)},
                   [&](const Brick& brick) {
                     for_each_cell_of(brick, [&](const Position& cell) { kinds.set(cell, 1); });
                   });
    uint64_t different = 0, visits = 0;
    visited(selection, width).for_each([&](const Position& cell, int found) {
      const int kind = kinds.at(cell);
      int64_t least = 4 * w * w;
      for (int64_t x = -w; x <= w; ++x)
        for (int64_t y = -w; y <= w; ++y)
          for (int64_t z = -w; z <= w; ++z) {
            int64_t square = 0;
            for (const int64_t d : {x, y, z})
              square += d == 0 ? 0 : (2 * std::abs(d) - 1) * (2 * std::abs(d) - 1);
            if (square < least && kinds.at({cell[0] + x, cell[1] + y, cell[2] + z}) != kind)
              least = square;
          }
      visits += found != INT_MAX;
      different += (found == INT_MAX ? 4 * w * w : found) != (kind == 1 ? -least : least);
    });
    EXPECT_EQ(different, 0u);
    EXPECT_GT(visits, 0u);
  }
  ExportReport exported(const char* format, const ExportOptions& options, Progress& progress,
                        uint64_t memory_bytes = 64 << 20) {
    const uint32_t levels = file_->grid_levels();
    return export_dag(system_files(), *file_,
                      {&export_format(format),
                       {levels, whole_grid(levels)},
                       folder_.file("out"),
                       memory_bytes,
                       false,
                       true,
                       options},
                      progress, CancelToken{});
  }

  TemporaryFolder folder_;
  std::unique_ptr<voxdag_reader::File> file_;
  std::optional<DagView> dag_;
};

TEST_F(LevelSetTest, DistancesEqualTheOracle) {
  write(solid());
  expect_right({5, whole_grid(5)}, 3);
  expect_right({5, {{9, 0, 3}, {20, 11, 32}}}, 2);
  expect_right({4, whole_grid(4)}, 1);
  expect_right({2, whole_grid(2)}, 3);
}

// A cube that consists of full bricks has a narrow band (the cells near the surface), although no
// brick has both set and empty cells.
TEST_F(LevelSetTest, AlignedCubesHaveABand) {
  write(voxels_where(5, [](int x, int y, int z) { return x >= 8 && x < 24 && y >= 16 && z < 16; }));
  expect_right({5, whole_grid(5)}, 2);
  expect_right({5, {{9, 17, 1}, {22, 30, 15}}}, 2);  // cuts a full cube
}

// If the complete file has an inside (narrow_band.h), the level set of a region has negative
// distances inside, even if the region is too thin to contain a cube of 3^3 set voxels.
TEST_F(LevelSetTest, ThinRegionsOfASolid) {
  write(voxels_where(5, [](int x, int, int) { return x < 17; }));
  EXPECT_TRUE(has_inside(*dag_, CancelToken{}));
  expect_right({5, {{16, 0, 0}, {32, 32, 32}}}, 3);
  NoProgress none;
  const Selection thin{5, {{16, 0, 0}, {32, 32, 32}}};
  for (const ExportFormat& format : export_formats()) {
    if (std::string(format.options).find("band") == std::string::npos) continue;
    const ExportRequest request{&format,
                                thin,
                                folder_.file("thin"),
                                64 << 20,
                                false,
                                true,
                                {.grid = GridKind::kSdf, .band = {}}};
    EXPECT_EQ(export_dag(system_files(), *file_, request, none, CancelToken{}).voxels, 32u * 32u);
  }
  write(voxels_where(5, [](int x, int, int) { return x == 15 || x == 16; }));
  EXPECT_FALSE(has_inside(*dag_, CancelToken{}));
}

// All cells whose centers are in a ball are set. Then each cell's distance in the level set differs
// from its distance to the sphere by less than a voxel.
TEST_F(LevelSetTest, ABallHasTheDistancesOfTheSphere) {
  constexpr double kCenter = 32.3, kRadius = 20.7;
  const auto distance = [](const Position& cell) {
    double square = 0;
    for (const int64_t c : cell)
      square += (static_cast<double>(c) + 0.5 - kCenter) * (static_cast<double>(c) + 0.5 - kCenter);
    return std::sqrt(square) - kRadius;
  };
  write(voxels_where(6, [&](int x, int y, int z) { return distance({x, y, z}) <= 0; }));
  constexpr int kWidth = 4;
  double worst = 0;
  uint64_t in_band = 0;
  visited({6, whole_grid(6)}, kWidth).for_each([&](const Position& cell, int square) {
    if (square == INT_MAX || std::abs(square) >= 4 * kWidth * kWidth) return;
    ++in_band;
    const double found = std::sqrt(std::abs(square)) / 2 * (square < 0 ? -1 : 1);
    worst = std::max(worst, std::abs(found - distance(cell)));
  });
  EXPECT_LT(worst, 1);
  EXPECT_GT(static_cast<double>(in_band), 4 * M_PI * kRadius * kRadius * 2 * (kWidth - 1));
}

TEST_F(LevelSetTest, ExportsReportTheirVoxelsAndProgress) {
  write(solid());
  for (const ExportFormat& format : export_formats()) {
    if (std::string(format.options).find("band") == std::string::npos) continue;
    SCOPED_TRACE(format.name);
    Stages stages;
    EXPECT_EQ(exported(format.name, {.grid = GridKind::kSdf, .band = {}}, stages).voxels,
              solid().count());
    stages.expect_complete();
    NoProgress none;
    const uint64_t narrow = exported(format.name, {.grid = GridKind::kSdf, .band = 1}, none).bytes;
    EXPECT_GT(exported(format.name, {.grid = GridKind::kSdf, .band = 8}, none).bytes, narrow);
    const auto message = [&](const ExportOptions& options, uint64_t memory_bytes) {
      return error_of([&] { exported(format.name, options, none, memory_bytes); }).message();
    };
    EXPECT_EQ(message({.grid = GridKind::kMask, .band = 2}, 64 << 20),
              "'band': expected also the grid sdf");
    EXPECT_EQ(message({.grid = GridKind::kSdf, .band = 17}, 64 << 20),
              "'band': expected a whole number from 1 to 16");
    EXPECT_NE(
        message({.grid = GridKind::kSdf, .band = {}}, 300 << 10).find("the grid would take over"),
        std::string::npos);
    // A shell has no inside.
    write(voxels_where(5, [](int x, int y, int z) { return (x + y + z) / 3 == 11; }));
    EXPECT_NE(message({.grid = GridKind::kSdf, .band = {}}, 64 << 20).find("--solid RULE"),
              std::string::npos);
    write(solid());
  }
}

}  // namespace
}  // namespace voxdag::query
