// Tests the options of exports: the axis that points up, options that only some formats have, and
// the numbers in the report.
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <map>
#include <set>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "query/export/turn/turned_dag.h"
#include "query/lookup/bricks.h"
#include "tests/unit/core/format/color/valued_files.h"

namespace voxdag::query {
namespace {

class ExportOptionsTest : public testing::Test {
 protected:
  ExportReport exported(const char* format, const ExportOptions& options) {
    NoProgress progress;
    ExportRequest request{&export_format(format), {6, whole_grid(6)}, output(format), 64 << 20};
    request.replace = true;
    request.options = options;
    return export_dag(system_files(), *file_, request, progress, CancelToken{});
  }
  std::string output(const std::string& format) const {
    return folder_.file(format == "hashdag" ? "out.basic_dag.dag.bin" : "out");
  }
  void SetUp() override {
    write_valued(folder_.file("a.vdag"), {6, 5, random_codes(7, 6, 300), smooth_colors(5, 3)},
                 AttributeSet::all(), 300);
    file_ = open_global_file(folder_.file("a.vdag"));
  }

  TemporaryFolder folder_;
  std::unique_ptr<voxdag_reader::File> file_;
};

std::set<Position> cells_of(const DagView& dag, uint32_t levels) {
  std::set<Position> cells;
  for_each_brick(dag, {levels, whole_grid(levels)}, [&](const Brick& brick) {
    for_each_cell_of(brick, [&](const Position& cell) { cells.insert(cell); });
  });
  return cells;
}

// A turned DAG has the cells that AxisTurn computes for each cell of the original, on several
// levels.
TEST_F(ExportOptionsTest, ADagIsTurnedCellByCell) {
  const DagView dag(*file_);
  for (const AxisTurn& turn : {kTurnYToZ, kTurnZToY}) {
    MemoryBudget budget(1 << 20);
    const TurnedDag turned(dag, turn, "a.vdag", budget, CancelToken{});
    for (const uint32_t levels : {6u, 4u}) {
      std::set<Position> expected;
      for (const Position& cell : cells_of(dag, levels)) {
        expected.insert(turn.turned(cell, int64_t{1} << levels));
        EXPECT_EQ(turn.original(turn.turned(cell, 64), 64), cell);
      }
      EXPECT_EQ(cells_of(turned.view(), levels), expected);
    }
    MemoryBudget little(100);
    EXPECT_THROW(TurnedDag(dag, turn, "a.vdag", little, CancelToken{}), Error);
  }
}

TEST_F(ExportOptionsTest, ATurnMapsYToZ) {
  EXPECT_EQ(kTurnYToZ.turned(Position{1, 2, 3}, 8), (Position{1, 4, 2}));
  EXPECT_EQ(kTurnZToY.turned(Position{1, 4, 2}, 8), (Position{1, 2, 3}));
  const Region region{{1, 2, 3}, {4, 6, 8}};
  EXPECT_EQ(kTurnYToZ.turned(region, 8), (Region{{1, 0, 2}, {4, 5, 6}}));
  EXPECT_EQ(kTurnYToZ.original(kTurnYToZ.turned(region, 8), 8), region);
}

// A turn does not change the attributes of a voxel, except that it turns its normal.
TEST_F(ExportOptionsTest, AttributesTurnWithTheirVoxels) {
  const auto rows = [&](UpAxis up) {
    ExportOptions options;
    options.up = up;
    const ExportReport report = exported("ply", options);
    const std::string bytes = read_bytes(output("ply"));
    std::map<std::array<double, 3>, std::string> found;
    const size_t row = 24 + 3 + 1 + 12 + 4;
    for (size_t at = bytes.find("end_header\n") + 11; at < bytes.size(); at += row) {
      std::array<double, 3> place;
      std::array<float, 3> normal;
      std::memcpy(place.data(), &bytes[at], 24);
      std::memcpy(normal.data(), &bytes[at + 28], 12);
      if (up == UpAxis::kZ) {  // back to the axes of the file
        place = {place[0], place[2], -place[1]};
        normal = {normal[0], normal[2], -normal[1]};
      }
      for (float& component : normal) component += 0;  // no -0
      std::string values = bytes.substr(at + 24, 4) + bytes.substr(at + 40, 4);
      values.append(reinterpret_cast<const char*>(normal.data()), 12);
      found[place] = values;
    }
    EXPECT_EQ(found.size(), report.voxels);
    return found;
  };
  EXPECT_EQ(rows(UpAxis::kY), rows(UpAxis::kZ));
}

TEST_F(ExportOptionsTest, OptionsOfOtherFormatsAreRefused) {
  ExportOptions compact;
  compact.compact = true;
  EXPECT_NO_THROW(exported("npz", compact));
  try {
    exported("ply", compact);
    FAIL() << "expected an error";
  } catch (const Error& error) {
    EXPECT_EQ(error.message(), "'compact': expected the format npz, not ply");
  }
  ExportOptions grid;
  grid.grid = GridKind::kDensity;
  EXPECT_THROW(exported("svdag", grid), Error);
}

TEST_F(ExportOptionsTest, CompactArraysAreCellsAndValues) {
  ExportOptions options;
  const uint64_t bytes = exported("npz", options).bytes;
  options.compact = true;
  const ExportReport report = exported("npz", options);
  EXPECT_GT(bytes, report.bytes + 24 * report.voxels);
  EXPECT_EQ(read_bytes(output("npz")).find("positions"), std::string::npos);
}

TEST_F(ExportOptionsTest, NumbersOfNotesAreFacts) {
  const auto names = [&](const char* format) {
    std::vector<std::string> found;
    for (const auto& [name, numbers] : exported(format, {}).facts) found.push_back(name);
    return found;
  };
  EXPECT_EQ(names("hashdag"), std::vector<std::string>{"scene_depth"});
  EXPECT_EQ(names("vox"), (std::vector<std::string>{"instances", "palette_colors"}));
  EXPECT_EQ(names("vtu"), std::vector<std::string>{"points"});
  EXPECT_EQ(names("glb"), (std::vector<std::string>{"rectangles", "triangles", "vertices"}));
}

}  // namespace
}  // namespace voxdag::query
