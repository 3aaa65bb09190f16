// A fixture for tests of packages, and a comparison of their tiles with the tiles of the file.
#pragma once

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/format/global/open_global.h"
#include "query/package/package_reader.h"
#include "query/package/write_package.h"
#include "query/tiles/tile.h"
#include "tests/support/error_of.h"
#include "tests/unit/query/query_files.h"

namespace voxdag::query {

namespace fs = std::filesystem;
using PackageWords = std::vector<uint32_t>;

class Package : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_.file(name); }
  PackageSpec spec(const voxdag_reader::File& file, const std::string& output) const {
    nlohmann::ordered_json manifest = {{"levels", file.grid_levels()}, {"tile_levels", 2}};
    if (file.has_colors()) manifest["colors"] = {{"levels", file.color_levels()}};
    PackageSpec spec;
    spec.output = path(output);
    spec.manifest = manifest.dump();
    spec.memory_bytes = uint64_t{64} << 20;
    return spec;
  }
  // Returns a spec of a package with a head.
  PackageSpec spec_with_head(const voxdag_reader::File& file, const std::string& output) const {
    PackageSpec with_head = spec(file, output);
    const auto edge = static_cast<double>(file.resolution());
    with_head.camera = Placement{
        {{1.4 * edge, 1.1 * edge, 1.9 * edge}}, {{0.5 * edge, 0.5 * edge, 0.5 * edge}}, 35};
    return with_head;
  }
  PackageReport write(const voxdag_reader::File& file, const PackageSpec& spec) {
    return write_package(
        file, spec, [&] { return viewer_; }, system_files(), progress_, never_);
  }
  void write_random(const std::string& output, int edge = 128) {
    const QueryFile scene(random_voxels(5, edge));
    const auto file = open_global_file(scene.path());
    write(*file, spec(*file, output));
  }
  nlohmann::ordered_json read_index(const std::string& output) const {
    return nlohmann::ordered_json::parse(read_bytes(path(output) + "/" + kIndexName));
  }
  void write_index(const std::string& output, const nlohmann::ordered_json& index) const {
    write_bytes(path(output) + "/" + kIndexName, index.dump());
  }
  void check(const std::string& output) {
    PackageReader(system_files(), path(output)).check(progress_, never_);
  }
  std::string check_error(const std::string& output) {
    return error_of([&] { check(output); }).message();
  }
  std::vector<std::string> names(const std::string& folder) const {
    std::vector<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_regular_file()) names.push_back(fs::relative(entry.path(), folder));
    std::sort(names.begin(), names.end());
    return names;
  }
  std::map<std::string, std::string> contents(const std::string& output) const {
    std::map<std::string, std::string> contents;
    for (const std::string& name : names(path(output)))
      contents[name] = read_bytes(path(output) + "/" + name);
    return contents;
  }
  std::string file_that_begins(const std::string& output, const std::string& begin) const {
    for (const std::string& name : names(path(output)))
      if (name.starts_with(begin)) return path(output) + "/" + name;
    ADD_FAILURE() << begin;
    return "";
  }

  TemporaryFolder folder_;
  NoProgress progress_;
  CancelToken never_;
  std::vector<ViewerFile> viewer_;
};

// Compares all tiles of a package with the results of encode_tile(). Returns the number of tiles.
inline uint64_t compare_tiles(const voxdag_reader::File& file, const PackageReader& package) {
  const DagView dag(file);
  const uint32_t bricks = file.brick_level();
  std::vector<uint64_t> offsets = {0};  // word offsets of the current band's roots, by tile number
  uint64_t count = 0;
  for (uint32_t level = 0; level < bricks;) {
    std::map<uint64_t, uint64_t> below;  // number -> word offset
    for (uint64_t number = 0; number < offsets.size(); ++number, ++count) {
      PackageWords expected = encode_tile(dag, kPackageTileLevels, {level, offsets[number]});
      PackageWords tile = package.tile(level, number);
      EXPECT_EQ(tile.size(), expected.size());
      if (!(tile.at(1) >> 16 & 1))
        for (size_t at = 4 + tile[2]; at < tile.size(); at += 4) {
          const uint64_t offset = expected.at(at) | uint64_t{expected[at + 1]} << 32;
          EXPECT_EQ(below.emplace(tile[at], offset).first->second, offset);
          tile[at] = expected[at];
          tile[at + 1] = expected[at + 1];
        }
      EXPECT_EQ(tile, expected) << level << " " << number;
    }
    level = tile_end(file.grid_levels(), kPackageTileLevels, level);
    offsets.clear();
    for (const auto& [number, offset] : below) {
      EXPECT_EQ(number, offsets.size());
      offsets.push_back(offset);
    }
    EXPECT_EQ(offsets.size(), level < bricks ? file.level(level).node_count : 0);
  }
  return count;
}

}  // namespace voxdag::query
