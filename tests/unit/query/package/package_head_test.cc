// Tests the heads of packages, which have the tiles of the first picture.
#include "query/package/first_tiles.h"
#include "tests/unit/query/package/package_fixture.h"

namespace voxdag::query {
namespace {

class PackageHead : public Package {};

// The tiles that the first picture needs are in the head, with the first numbers of their bands.
TEST_F(PackageHead, HasTheFirstTiles) {
  for (const int edge : {8, 64, 256}) {
    const QueryFile scene(random_voxels(static_cast<uint64_t>(edge), edge));
    const auto file = open_global_file(scene.path());
    const std::string output = "h" + std::to_string(edge);
    const PackageSpec with_head = spec_with_head(*file, output);
    const PackageReport report = write(*file, with_head);
    const PackageReader package(system_files(), path(output));
    EXPECT_EQ(compare_tiles(*file, package), report.tiles);
    package.check(progress_, never_);
    const FirstTiles first = find_first_tiles(DagView(*file), *with_head.camera, never_);
    uint64_t head_blocks = 0;
    for (const PackageBand& band : package.index().bands) {
      EXPECT_EQ(band.head_tiles, first[band.level].size()) << band.level;
      head_blocks += band.head_blocks();
    }
    EXPECT_EQ(package.index().head.lengths.size(), head_blocks);
    EXPECT_EQ(report.files, names(path(output)).size());
    // A reader needs no other file for these tiles.
    for (const PackageFile& pack : package.index().packs)
      fs::remove(path(output + "/") + pack.name);
    for (const PackageBand& band : package.index().bands)
      for (uint64_t number = 0; number < band.head_tiles; ++number)
        EXPECT_NO_THROW(package.tile(band.level, number));
  }
}

// A picture from far away shows the scene as few large cells, so it needs few tiles.
TEST_F(PackageHead, IsSmallIfTheSceneIsFarAway) {
  const QueryFile scene(random_voxels(5, 256));
  const auto file = open_global_file(scene.path());
  const auto count = [&](double distance) {
    const Placement camera{{{128, 128, 128 + distance}}, {{128, 128, 128}}, 35};
    size_t tiles = 0;
    for (const auto& level : find_first_tiles(DagView(*file), camera, never_))
      tiles += level.size();
    return tiles;
  };
  EXPECT_GT(count(300), 50u);
  EXPECT_EQ(count(30000), 1u);  // the root
  for (const double distance : {1.5, 20.0, 150.0, 400.0})
    EXPECT_LE(count(distance), kMaxFirstTiles) << distance;
}

// An index without the band of the finest tiles is damaged, although all blocks that it names are
// intact.
TEST_F(PackageHead, NamesAMissingBand) {
  const QueryFile scene(random_voxels(5, 64));
  const auto file = open_global_file(scene.path());
  // The first picture of "far" needs only the root. The head of "near" has all tiles, so its
  // directory is empty.
  PackageSpec far = spec_with_head(*file, "far");
  far.camera = Placement{{{32, 32, 10000}}, {{32, 32, 32}}, 35};
  write(*file, far);
  write(*file, spec_with_head(*file, "near"));
  auto index = read_index("far");
  const auto near = read_index("near");
  ASSERT_TRUE(near["packs"].empty());
  ASSERT_EQ(index["bands"].size(), 2u);
  index["bands"].erase(1);
  index["packs"] = near["packs"];
  index["directory"] = near["directory"];
  const std::string directory = "/" + near["directory"]["name"].get<std::string>();
  fs::copy_file(path("near") + directory, path("far") + directory);
  write_index("far", index);
  EXPECT_THAT(check_error("far"), testing::HasSubstr("the finest tiles refer to"));
}

TEST_F(PackageHead, NamesDamage) {
  const QueryFile scene(random_voxels(5, 256));
  const auto file = open_global_file(scene.path());
  write(*file, spec_with_head(*file, "p"));
  const std::string head = file_that_begins("p", "head-"), intact = read_bytes(head);
  std::string flipped = intact;
  flipped[flipped.size() / 2] = static_cast<char>(flipped[flipped.size() / 2] ^ 4);
  write_bytes(head, flipped);
  EXPECT_THAT(check_error("p"), testing::StartsWith(head));
  fs::remove(head);
  EXPECT_THAT(check_error("p"), testing::HasSubstr(head));
  write_bytes(head, intact);
  check("p");
  const std::string index = path("p/package.json"), text = read_bytes(index);
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string changed = text;
    const size_t at = changed.rfind(from);
    if (at == changed.npos) return "no " + from;
    changed.replace(at, from.size(), to);
    write_bytes(index, changed);
    return check_error("p");
  };
  EXPECT_THAT(replaced("\"head\":{", "\"other\":{"),
              testing::HasSubstr("'head': expected the sizes of the blocks"));
  EXPECT_THAT(replaced("\"blocks\":[", "\"blocks\":[65536,"),
              testing::HasSubstr("expected a list of block sizes of at most 65535 bytes"));
  EXPECT_THAT(replaced("\"blocks\":[", "\"blocks\":[1,"), testing::HasSubstr("'head': expected"));
  // The last band would have one more tile in the head.
  const PackageBand band = parse_index(text, index).bands.back();
  ASSERT_LT(band.head_tiles, band.items);
  ASSERT_NE(band.head_tiles % kBlockTiles, 0u);
  const std::string member = "\"head_tiles\":";
  EXPECT_THAT(replaced(member + std::to_string(band.head_tiles),
                       member + std::to_string(band.head_tiles + 1)),
              testing::HasSubstr("its first new tile has the number"));
}

TEST_F(PackageHead, HasTheVersion) {
  const QueryFile scene(random_voxels(7, 64));
  const auto file = open_global_file(scene.path());
  write(*file, spec(*file, "p"));
  auto index = read_index("p");
  EXPECT_EQ(index.value("version", 0), 3);
  EXPECT_FALSE(index.contains("head"));
  for (const int version : {1, 2, 4}) {
    index["version"] = version;
    write_index("p", index);
    EXPECT_THAT(check_error("p"), testing::HasSubstr("it has version " + std::to_string(version) +
                                                     " of the format, expected version 3"));
    if (version > 3)
      EXPECT_THROW(write(*file, spec(*file, "p")), Error);
    else
      write(*file, spec(*file, "p"));  // replaces the package
    EXPECT_EQ(read_index("p").value("version", 0), version > 3 ? version : 3);
  }
}

}  // namespace
}  // namespace voxdag::query
