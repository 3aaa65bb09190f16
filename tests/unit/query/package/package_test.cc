// Tests packages: their tiles and color pages must be the same as in the file, and damage must be
// found.
#include <gmock/gmock.h>

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/process_limits.h"
#include "core/format/global/open_global.h"
#include "core/geometry/morton.h"
#include "query/package/gzip_block.h"
#include "query/package/package_reader.h"
#include "query/package/tile_block.h"
#include "query/package/write_package.h"
#include "query/tiles/color_page.h"
#include "query/tiles/tile.h"
#include "tests/support/error_of.h"
#include "tests/support/faulty_files.h"
#include "tests/unit/core/format/color/colored_files.h"
#include "tests/unit/query/package/package_fixture.h"
#include "tests/unit/query/query_files.h"

namespace voxdag::query {
namespace {

TEST_F(Package, HasTheTilesOfTheFile) {
  for (const int edge : {8, 16, 64, 128}) {
    const QueryFile scene(random_voxels(static_cast<uint64_t>(edge), edge));
    const auto file = open_global_file(scene.path());
    const PackageReport report = write(*file, spec(*file, "p" + std::to_string(edge)));
    const PackageReader package(system_files(), path("p" + std::to_string(edge)));
    EXPECT_EQ(compare_tiles(*file, package), report.tiles);
    package.check(progress_, never_);
    EXPECT_EQ(error_of([&] { package.tile(0, 1); }).code(), ErrorCode::kNotFound);
    EXPECT_EQ(error_of([&] { package.tile(77, 0); }).code(), ErrorCode::kNotFound);
  }
}

TEST_F(Package, OfFilesWithoutTiles) {
  for (const int edge : {4, 16}) {
    const std::string name = "e" + std::to_string(edge);
    oracle::Voxels voxels(edge);
    if (edge == 4) voxels.set(1, 2, 3);
    const QueryFile scene(voxels);
    const auto file = open_global_file(scene.path());
    EXPECT_EQ(write(*file, spec(*file, name)).tiles, 0u);
    check(name);
  }
}

TEST_F(Package, HasTheColorsOfTheFile) {
  for (const uint32_t color_levels : {3u, 8u}) {
    const ColoredScene scene{9, color_levels, random_codes(4, 9, 1500),
                             smooth_colors(color_levels, 3)};
    write_colored(path("c.vdag"), scene, true);
    const auto file = open_global_file(path("c.vdag"));
    const DagView dag(*file);
    ColorPages pages(*file, dag);
    const std::string output = "c" + std::to_string(color_levels);
    const PackageReport report = write(*file, spec(*file, output));
    const PackageReader package(system_files(), path(output));
    package.check(progress_, never_);
    uint64_t count = 0;
    for (uint32_t level = 0; level <= color_levels; ++level) {
      std::set<uint64_t> codes;
      for (const uint64_t code : scene.cells(level)) codes.insert(code >> 9);
      for (const uint64_t code : codes) {
        uint32_t x, y, z;
        morton_decode(code, x, y, z);
        ASSERT_EQ(package.color_page(level, {x, y, z}), pages.encode({level, {x, y, z}}));
        ++count;
      }
    }
    EXPECT_EQ(count, report.color_pages);
    PackageSpec gray = spec(*file, "gray" + std::to_string(color_levels));
    gray.colors = false;
    EXPECT_EQ(write(*file, gray).color_pages, 0u);
    EXPECT_EQ(PackageReader(system_files(), gray.output).index().manifest.find("colors"),
              std::string::npos);
    check("gray" + std::to_string(color_levels));
  }
}

// The bytes of a package do not depend on the number of threads, on the memory, or on the pointer
// sizes in the file.
TEST_F(Package, IsTheSameForAnyRun) {
  const oracle::Voxels voxels = random_voxels(3, 128);
  const QueryFile scene(voxels), wide(voxels, 64);
  const auto file = open_global_file(scene.path()), wide_file = open_global_file(wide.path());
  write(*file, spec_with_head(*file, "a"));
  PackageSpec other = spec_with_head(*file, "b");
  other.threads = 4;
  other.list_bytes = 64;
  write(*file, other);
  EXPECT_EQ(contents("a"), contents("b"));
  write(*wide_file, spec_with_head(*wide_file, "w"));
  EXPECT_EQ(contents("a"), contents("w"));
}

// If only the first pack exists, the reader still returns the tiles in it, such as the root tile.
TEST_F(Package, IsCoarserWithoutItsLastPacks) {
  const ColoredScene scene{12, 3, random_codes(8, 12, 20000), smooth_colors(3, 3)};
  write_colored(path("c.vdag"), scene, false);
  const auto file = open_global_file(path("c.vdag"));
  PackageSpec small = spec(*file, "p");
  small.pack_bytes = 1024;
  ASSERT_GT(write(*file, small).packs, 3u);
  const PackageReader package(system_files(), path("p"));
  const std::vector<PackageFile>& packs = package.index().packs;
  for (size_t i = 1; i < packs.size(); ++i) fs::remove(path("p/") + packs[i].name);
  const PackageWords root = package.tile(0, 0);
  EXPECT_EQ(root, [&] {
    PackageWords words = encode_tile(DagView(*file), 2, {0, 0});
    for (size_t i = 0, at = 4 + words[2]; at < words.size(); at += 4, ++i)
      words[at] = static_cast<uint32_t>(i);
    return words;
  }());
  const uint32_t last = package.index().bands.back().level;
  EXPECT_EQ(error_of([&] { package.tile(last, package.index().bands.back().items - 1); }).code(),
            ErrorCode::kNotFound);
  EXPECT_THAT(check_error("p"), testing::HasSubstr(packs[1].name));
}

TEST_F(Package, NamesDamage) {
  write_random("p");
  const std::string pack = file_that_begins("p", "packs/0-"),
                    directory = file_that_begins("p", "directory-");
  for (const std::string& file : {pack, directory}) {
    const std::string intact = read_bytes(file);
    std::string flipped = intact;
    flipped[flipped.size() / 2] = static_cast<char>(flipped[flipped.size() / 2] ^ 4);
    write_bytes(file, flipped);
    EXPECT_THAT(check_error("p"), testing::StartsWith(file));
    write_bytes(file, intact.substr(0, intact.size() - 1));
    EXPECT_THAT(check_error("p"), testing::StartsWith(file));
    fs::remove(file);
    EXPECT_THAT(check_error("p"), testing::HasSubstr(file));
    write_bytes(file, intact);
  }
  check("p");
}

// A viewer shows the manifest, but only the digest tells whether it belongs to the files.
TEST_F(Package, NamesAnotherDigest) {
  write_random("p");
  const nlohmann::ordered_json intact = read_index("p");
  for (const auto& [member, value] : {std::pair<const char*, nlohmann::json>{"name", "other"},
                                      {"digest", std::string(32, '0')},
                                      {"digest", 7}}) {
    SCOPED_TRACE(member);
    nlohmann::ordered_json index = intact;
    index["manifest"][member] = value;
    write_index("p", index);
    EXPECT_THAT(check_error("p"), testing::HasSubstr("package.json: 'digest' of the manifest is"));
  }
  write_index("p", intact);
  check("p");
}

// After a change of any one byte of the index, the reader does not crash. If it reports an error,
// the message names the package.
TEST_F(Package, RefusesChangedIndexes) {
  write_random("p", 64);
  const std::string file = path("p/package.json"), intact = read_bytes(file);
  for (size_t at = 0; at < intact.size(); ++at) {
    std::string changed = intact;
    changed[at] = changed[at] == '9' ? '1' : '9';
    write_bytes(file, changed);
    try {
      check("p");
    } catch (const Error& error) {
      EXPECT_THAT(error.message(), testing::HasSubstr(path("p")));
    }
  }
  write_bytes(file, "{}");
  EXPECT_THAT(check_error("p"), testing::HasSubstr("'format': expected 'voxdag package'"));
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string changed = intact;
    changed.replace(changed.find(from), from.size(), to);
    write_bytes(file, changed);
    return check_error("p");
  };
  EXPECT_THAT(replaced("\"tile_levels\":2", "\"tile_levels\":\"2\""),
              testing::HasSubstr("'tile_levels' of the manifest is not valid: expected 2"));
  EXPECT_THAT(replaced("\"tile_levels\":2", "\"a\":" + std::string(100000, '[')),
              testing::HasSubstr("expected"));
  const std::string deep = std::string(50000, '[') + std::string(50000, ']');
  EXPECT_THAT(replaced("\"tile_levels\":2", "\"tile_levels\":2,\"a\":" + deep),
              testing::HasSubstr("expected a depth of at most 32"));
  std::string bands;
  for (int i = 0; i < 2048; ++i)
    bands += R"({"level":1,"pages":9007199254740992,"blocks":9007199254740992},)";
  EXPECT_THAT(replaced("\"bands\":[", "\"bands\":[" + bands),
              testing::HasSubstr("at most two bands of each level"));
  // 2048 packs of 2^53 blocks: the sum of all blocks would wrap around and be correct.
  std::string packs;
  for (int i = 0; i < 2048; ++i)
    packs += R"({"name":"packs/0-a.bin","bytes":0,"blocks":9007199254740992},)";
  EXPECT_THAT(replaced("\"packs\":[", "\"packs\":[" + packs),
              testing::HasSubstr("'blocks': expected a sum of at most 2^53"));
  EXPECT_THAT(replaced("\"packs\":[", R"("packs":[{"name":"packs/0-a.bin","bytes":0,"blocks":0},)"),
              testing::HasSubstr("'blocks': expected at least one block in each pack"));
  for (const std::string name : {"index.html", "package.json"})
    EXPECT_THAT(
        replaced("\"packs\":[{\"name\":\"", "\"packs\":[{\"name\":\"" + name + "\",\"a\":\""),
        testing::HasSubstr("'name': expected the name of a file in the package"));
}

// A package of few bytes whose directory has many blocks of 20 bytes.
struct HostilePackage {
  uint64_t pages = 0;
  uint16_t block_bytes = 20;
  void write(const std::string& folder) const {
    std::string plain;
    for (uint64_t i = 0; i < kPageBlocks; ++i)
      plain += {static_cast<char>(block_bytes & 255), static_cast<char>(block_bytes >> 8)};
    const std::string page = gzip_block(plain);
    const uint64_t blocks = pages * kPageBlocks;
    std::string directory;
    PackageIndex index;
    index.manifest = R"({"levels":20,"tile_levels":2})";
    index.bands = {{.level = 0, .items = blocks * kBlockTiles, .blocks = blocks}};
    index.packs = {{"packs/0-a.bin", 30 * blocks, blocks}};
    for (uint64_t i = 0; i < pages; ++i) {
      index.pages.push_back({.bytes = page.size(), .offset = i * kPageBlocks * 20});
      directory += page;
    }
    index.directory = {hashed_name("directory", directory, ".bin"), directory.size()};
    fs::create_directories(folder);
    write_bytes(folder + "/package.json", index_text(index));
    write_bytes(folder + "/" + index.directory.name, directory);
  }
};

// The reader's memory does not depend on the number of blocks.
TEST_F(Package, ReadsManyPagesInLittleMemory) {
  constexpr uint64_t kPages = 2000;  // 8 M blocks, whose places would take 250 MiB
  HostilePackage{.pages = kPages}.write(path("p"));
  const uint64_t before = resident_bytes();
  const PackageReader package(system_files(), path("p"));
  EXPECT_LT(resident_bytes(), before + (uint64_t{32} << 20));
  EXPECT_EQ(error_of([&] { package.tile(0, kPages * kPageBlocks * kBlockTiles - 1); }).code(),
            ErrorCode::kNotFound);  // the pack
}

TEST_F(Package, RefusesWrongDirectories) {
  HostilePackage{.pages = 2, .block_bytes = 19}.write(path("p"));
  EXPECT_THAT(check_error("p"), testing::HasSubstr("block 0 has 19 bytes, expected 20 or more"));
  HostilePackage{.pages = 2, .block_bytes = 21}.write(path("p"));
  EXPECT_THAT(check_error("p"), testing::HasSubstr("page 1 begins at another block"));
  const std::string index = path("p/package.json");
  write_bytes(index, std::string(kMaxIndexBytes, ' ') + read_bytes(index));
  EXPECT_THAT(check_error("p"), testing::HasSubstr("package.json has"));
  EXPECT_THAT(check_error("p"), testing::HasSubstr("expected at most 8388608"));
}

// A page of the directory can begin in the middle of the blocks of a band of color pages.
TEST_F(Package, ReadsColorsAfterTheFirstPageOfTheDirectory) {
  constexpr uint64_t kBlocks = 2 * kPageBlocks, kBlockBytes = 20;
  PackageIndex index;
  index.manifest = R"({"levels":5,"tile_levels":2})";
  index.bands = {{.level = 0, .items = 1, .blocks = 1},
                 {.is_color = true, .level = 1, .items = kBlocks - 1, .blocks = kBlocks - 1}};
  index.packs = {{"packs/0-a.bin", kBlocks * kBlockBytes, kBlocks}};
  std::string directory;
  for (uint64_t page = 0; page < 2; ++page) {
    std::string lengths, low, high;
    const uint64_t first = page * kPageBlocks;
    for (uint64_t block = first; block < first + kPageBlocks; ++block) {
      lengths += {static_cast<char>(kBlockBytes), 0};
      if (block == 0) continue;
      low += {static_cast<char>(block & 255), static_cast<char>(block >> 8), 0, 0};
      high += std::string(4, '\0');
    }
    const std::string bytes = gzip_block(lengths + low + high);
    index.pages.push_back({.bytes = bytes.size(), .offset = first * kBlockBytes, .code = first});
    directory += bytes;
  }
  index.directory = {hashed_name("directory", directory, ".bin"), directory.size()};
  fs::create_directories(path("p"));
  write_bytes(path("p/package.json"), index_text(index));
  write_bytes(path("p/") + index.directory.name, directory);
  const PackageReader package(system_files(), path("p"));
  EXPECT_EQ(error_of([&] {
              package.color_page(1, {7, 7, 7});
            }).code(),
            ErrorCode::kNotFound);  // the pack
}

// Decoding a damaged block throws Error{kCorrupt} or returns the right number of tiles.
TEST_F(Package, SurvivesDamagedBlocks) {
  const QueryFile scene(random_voxels(7, 64));
  const auto file = open_global_file(scene.path());
  const DagView dag(*file);
  TileBlockEncoder encoder(0);
  PackageWords root = encode_tile(dag, 2, {0, 0});
  for (size_t i = 0, at = 4 + root[2]; at < root.size(); at += 4, ++i)
    root[at] = static_cast<uint32_t>(i);
  encoder.add(root);
  const std::string block = encoder.finish();
  EXPECT_EQ(decode_tile_block(block, 6, 0, 1).tiles[0], root);
  for (size_t at = 0; at < block.size(); ++at)
    for (int bit = 0; bit < 8; ++bit) {
      std::string changed = block;
      changed[at] = static_cast<char>(changed[at] ^ 1 << bit);
      try {
        EXPECT_EQ(decode_tile_block(changed, 6, 0, 1).tiles.size(), 1u);
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      }
    }
  for (size_t size = 0; size < block.size(); ++size)
    EXPECT_THROW(decode_tile_block(block.substr(0, size), 6, 0, 1), Error);
}

// The files of the viewer can take time to make, because they can include a rendered picture
// (poster). So they are not made if the output is refused.
TEST_F(Package, ChecksTheOutputBeforeItMakesTheViewer) {
  const QueryFile scene(random_voxels(5, 8));
  const auto file = open_global_file(scene.path());
  bool is_made = false;
  const ViewerMaker make_viewer = [&] {
    is_made = true;
    return viewer_;
  };
  write_bytes(path("file"), "mine");
  for (const std::string output : {"file", "no/p"})
    EXPECT_THROW(
        write_package(*file, spec(*file, output), make_viewer, system_files(), progress_, never_),
        Error);
  EXPECT_FALSE(is_made);
  write_package(*file, spec(*file, "p"), make_viewer, system_files(), progress_, never_);
  EXPECT_TRUE(is_made);
}

TEST_F(Package, ReplacesOnlyPackages) {
  fs::create_directories(path("other"));
  write_bytes(path("other/mine.txt"), "mine");
  const QueryFile scene(random_voxels(5, 32)), second(random_voxels(6, 64));
  const auto file = open_global_file(scene.path()), file2 = open_global_file(second.path());
  EXPECT_THAT(error_of([&] { write(*file, spec(*file, "other")); }).message(),
              testing::HasSubstr("has files that are not of a package: expected a new folder"));
  EXPECT_EQ(names(path("other")), std::vector<std::string>{"mine.txt"});
  write_bytes(path("file"), "mine");
  EXPECT_THAT(error_of([&] { write(*file, spec(*file, "file")); }).message(),
              testing::HasSubstr("is a file"));
  EXPECT_EQ(error_of([&] { write(*file, spec(*file, "no/p")); }).code(), ErrorCode::kNotFound);

  fs::create_directories(path("p"));  // an empty folder
  write(*file, spec_with_head(*file, "p"));
  write_bytes(path("p/CNAME"), "example.org");
  write(*file2, spec_with_head(*file2, "p"));
  check("p");
  write(*file2, spec_with_head(*file2, "q"));
  auto expected = contents("q");
  expected["CNAME"] = "example.org";
  EXPECT_EQ(contents("p"), expected);
  for (const auto& entry : fs::directory_iterator(folder_.path()))
    EXPECT_EQ(entry.path().string().find(".work-"), std::string::npos);
}

// If the disk fails during the replacement of a package, the folder still has a complete package,
// the old one or the new one.
TEST_F(Package, IsCompleteAfterFaults) {
  const QueryFile scene(random_voxels(5, 8)), second(random_voxels(6, 8));
  const auto file = open_global_file(scene.path()), file2 = open_global_file(second.path());
  for (const crash::Fault fault : {crash::Fault::kNoSpace, crash::Fault::kIoError}) {
    bool failed = true;
    for (uint64_t at = 1; failed; at += 2) {
      fs::remove_all(path("p"));
      fs::remove(path("p.lock"));
      write(*file, spec(*file, "p"));
      crash::FaultyFiles faulty({fault, at});
      failed = false;
      try {
        write_package(*file2, spec(*file2, "p"), {}, faulty, progress_, never_);
      } catch (const Error& error) {
        failed = true;
        EXPECT_EQ(error.code(),
                  fault == crash::Fault::kNoSpace ? ErrorCode::kNoSpace : ErrorCode::kIo);
      }
      check("p");
    }
  }
}

TEST_F(Package, LeavesNothingAfterErrors) {
  const QueryFile scene(random_voxels(5, 32));
  const auto file = open_global_file(scene.path());
  CancelToken canceled;
  canceled.cancel();
  EXPECT_EQ(error_of([&] {
              write_package(*file, spec(*file, "p"), {}, system_files(), progress_, canceled);
            }).code(),
            ErrorCode::kCanceled);
  EXPECT_TRUE(names(folder_.path()).empty());
}

}  // namespace
}  // namespace voxdag::query
