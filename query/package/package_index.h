// The index of a package, package.json (docs/format.md, "Packages").
//
// A package is a folder of files for web servers: the tiles and color pages of one DAG, for viewers
// that need no voxdag server. Blocks are the units that viewers decode. Packs are files of blocks.
// Blocks are numbered in the order in which the packs store them.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace voxdag::query {

// Maximum number of levels of nodes in a tile of a package. Each tile that a view needs brings
// tiles that it does not need into the same block, so tiles are smaller than the tiles of the
// service.
inline constexpr uint32_t kPackageTileLevels = 2;
// Number of tiles in a block. The last block of a band may have fewer.
inline constexpr uint32_t kBlockTiles = 64;
// Number of blocks whose entries a page of the directory has. The last page may have fewer.
inline constexpr uint64_t kPageBlocks = 4096;
// Size of the first pack, which viewers read completely. Other packs are larger.
inline constexpr uint64_t kFirstPackBytes = uint64_t{256} << 10;

// A band is a sequence of blocks: the tiles whose roots are on one level, or the color pages of one
// level.
struct PackageBand {
  bool is_color = false;
  uint32_t level = 0;
  uint64_t items = 0;  // tiles or pages
  uint64_t blocks = 0;
};

// A page of the directory, and the place of the first block that it describes.
struct DirectoryPage {
  uint64_t bytes = 0;
  uint64_t pack = 0;
  uint64_t offset = 0;
  uint64_t code = 0;  // of the first color page in the block; 0 for tiles
};

struct PackageFile {
  std::string name;
  uint64_t bytes = 0;
  uint64_t blocks = 0;  // of a pack
};

struct PackageIndex {
  std::string manifest;  // JSON, as the service sends it, for tiles of kPackageTileLevels levels
  std::vector<PackageBand> bands;  // in the order of their blocks
  PackageFile directory;
  std::vector<DirectoryPage> pages;
  std::vector<PackageFile> packs;
  std::vector<PackageFile> viewer;  // files of the viewer that have the hash of their contents
};

inline constexpr const char* kIndexName = "package.json";

std::string index_text(const PackageIndex& index);
// Parses the text of package.json and checks that its numbers are consistent. Throws
// Error{kCorrupt}, or Error{kUnsupportedVersion}; messages begin with `path`.
PackageIndex parse_index(std::string_view text, const std::string& path);

// Returns `stem`-HASH`suffix`, where HASH is the hash of the contents.
std::string hashed_name(const std::string& stem, std::string_view contents,
                        const std::string& suffix);

}  // namespace voxdag::query
