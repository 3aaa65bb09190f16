// Decodes exports to OctoMap's .ot: the occupied leaves are the voxels with their colors, free
// leaves fill the rest of the region, and inner nodes have the maximum occupancy and the mean color
// of their children.
#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <set>

#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "query/lookup/bricks.h"
#include "tests/unit/core/format/color/colored_files.h"

namespace voxdag::query {
namespace {

struct OtDecoded {
  // By position in cells, relative to the octree's origin.
  std::map<Position, voxdag_reader::Rgb> occupied;
  uint64_t free_cells = 0, nodes = 0;
  std::string header;
};

class OtDecoder {
 public:
  OtDecoder(const std::string& bytes, bool has_colors) : bytes_(bytes), has_colors_(has_colors) {
    at_ = bytes.find("\ndata\n") + 6;
    decoded_.header = bytes.substr(0, at_);
    node({-32768, -32768, -32768}, 65536);
    EXPECT_EQ(at_, bytes.size());
  }
  const OtDecoded& decoded() const { return decoded_; }

 private:
  struct Node {
    float log_odds;
    std::array<int, 3> color;
  };

  uint8_t byte() { return static_cast<uint8_t>(bytes_.at(at_++)); }
  Node node(const Position& corner, int64_t edge) {
    ++decoded_.nodes;
    Node found{0, {255, 255, 255}};
    std::memcpy(&found.log_odds, &bytes_.at(at_), 4);
    at_ += 4;
    if (has_colors_)
      for (int& channel : found.color) channel = byte();
    const uint8_t mask = byte();
    if (mask == 0) {
      leaf(found, corner, edge);
      return found;
    }
    float most = -1e9F;
    std::array<int, 4> sums{};
    for (int child = 0; child < 8; ++child) {
      if (!(mask >> child & 1)) continue;
      const int64_t half = edge / 2;
      const Node below =
          node({corner[0] + (child & 1 ? half : 0), corner[1] + (child & 2 ? half : 0),
                corner[2] + (child & 4 ? half : 0)},
               half);
      most = std::max(most, below.log_odds);
      if (below.color == std::array{255, 255, 255}) continue;
      ++sums[3];
      for (size_t i = 0; i < 3; ++i) sums[i] += below.color[i];
    }
    EXPECT_EQ(found.log_odds, most);
    for (size_t i = 0; i < 3; ++i)
      EXPECT_EQ(found.color[i], sums[3] == 0 ? 255 : sums[i] / sums[3]);
    return found;
  }
  void leaf(const Node& node, const Position& corner, int64_t edge) {
    if (node.log_odds < 0) {
      EXPECT_EQ(node.log_odds, -2.0F);
      decoded_.free_cells += cells_of_cube(edge);
      return;
    }
    EXPECT_EQ(node.log_odds, 3.511F);
    const auto channel = [&](size_t i) { return static_cast<uint8_t>(node.color[i]); };
    for (int64_t x = 0; x < edge; ++x)
      for (int64_t y = 0; y < edge; ++y)
        for (int64_t z = 0; z < edge; ++z)
          EXPECT_TRUE(decoded_.occupied
                          .emplace(Position{corner[0] + x, corner[1] + y, corner[2] + z},
                                   voxdag_reader::Rgb{channel(0), channel(1), channel(2)})
                          .second);
  }

  const std::string& bytes_;
  const bool has_colors_;
  size_t at_ = 0;
  OtDecoded decoded_;
};

class OtTest : public testing::Test {
 protected:
  void open(uint32_t levels, std::vector<uint64_t> codes) {
    const auto by_place = [](uint64_t code) {
      return sum_of_color(static_cast<int>(code % 251), static_cast<int>(code / 7 % 256),
                          static_cast<int>(code / 64 % 256), 1);
    };
    write_colored(folder_.file("a.vdag"), {levels, levels, std::move(codes), by_place});
    file_ = open_global_file(folder_.file("a.vdag"));
  }
  OtDecoded exported(const Selection& selection, bool gray) {
    NoProgress progress;
    const ExportReport report =
        export_dag(system_files(), *file_,
                   {&export_format("ot"), selection, folder_.file("a.ot"), 64 << 20, gray, true},
                   progress, CancelToken{});
    const std::string bytes = read_bytes(folder_.file("a.ot"));
    const OtDecoded decoded = OtDecoder(bytes, !gray).decoded();
    EXPECT_EQ(report.voxels, decoded.occupied.size());
    EXPECT_NE(decoded.header.find("\nsize " + std::to_string(decoded.nodes) + "\n"),
              std::string::npos);
    EXPECT_TRUE(decoded.header.starts_with("# Octomap OcTree file\n"));
    EXPECT_NE(decoded.header.find(gray ? "id OcTree\n" : "id ColorOcTree\n"), std::string::npos);
    return decoded;
  }
  void expect_cells(const Selection& selection, const OtDecoded& decoded, bool gray) {
    voxdag_reader::ColorCursor colors(*file_);
    size_t count = 0;
    for_each_brick(DagView(*file_), selection, [&](const Brick& brick) {
      for_each_cell_of(brick, [&](const Position& cell) {
        ++count;
        const auto found = decoded.occupied.find(cell);
        ASSERT_TRUE(found != decoded.occupied.end());
        const auto color = colors.color(cell[0], cell[1], cell[2], selection.grid_levels);
        if (gray)
          EXPECT_EQ(found->second.r, 255);
        else
          EXPECT_TRUE(found->second == *color);
      });
    });
    EXPECT_EQ(decoded.occupied.size(), count);
  }

  TemporaryFolder folder_;
  std::unique_ptr<voxdag_reader::File> file_;
};

TEST_F(OtTest, HasTheVoxelsAndTheirColors) {
  open(7, random_codes(3, 7, 2000));
  for (const Selection& selection : {Selection{7, whole_grid(7)}, Selection{5, whole_grid(5)},
                                     Selection{7, {{5, 9, 3}, {120, 70, 128}}}})
    for (const bool gray : {false, true}) {
      const OtDecoded decoded = exported(selection, gray);
      expect_cells(selection, decoded, gray);
      if (selection.region == whole_grid(selection.grid_levels)) {
        EXPECT_EQ(decoded.free_cells + decoded.occupied.size(),
                  uint64_t{1} << 3 * selection.grid_levels);
      }
    }
}

// Without colors, a full cube is one leaf. With colors, each voxel is a leaf.
TEST_F(OtTest, FullCubesAreLeavesWithoutColors) {
  std::vector<uint64_t> all(32 * 32 * 32);
  for (size_t i = 0; i < all.size(); ++i) all[i] = i;
  open(5, all);
  const Selection selection{5, whole_grid(5)};
  EXPECT_LT(exported(selection, true).nodes, 20u);
  EXPECT_GT(exported(selection, false).nodes, all.size());
}

}  // namespace
}  // namespace voxdag::query
