// The index of a package, package.json (docs/format.md, "Packages").
//
// A package is a folder with the tiles and color pages of one DAG, and a viewer. Any web server can
// serve it. Several tiles or color pages are compressed together as a block. Several blocks are
// stored in one file, a pack. Blocks are numbered from 0, in the order in which they are stored.
// The directory is a file with the sizes of these blocks. It consists of pages, which are
// compressed separately.
//
// The head is a small file with further blocks: those with the tiles that the first picture needs
// (first_tiles.h). These tiles have the lowest numbers of their bands. The index has the sizes of
// the head's blocks, so a viewer needs no other file for the first picture.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace voxdag::query {

// Maximum number of levels of nodes in a tile of a package. It is smaller than for the tiles of the
// service: a viewer can only load complete blocks, and so loads many tiles that it does not need.
inline constexpr uint32_t kPackageTileLevels = 2;
// Number of tiles in a block. The last block of a band (PackageBand) can have fewer.
inline constexpr uint32_t kBlockTiles = 64;
// Number of blocks that a page of the directory describes. The last page can describe fewer.
inline constexpr uint64_t kPageBlocks = 4096;
// Maximum number of blocks in the head.
inline constexpr uint64_t kMaxHeadBlocks = 4096;
// Maximum size of the first pack. Viewers must read packs completely from a server that does not
// support requests for ranges. Then this small pack lets them draw the coarse bands soon.
inline constexpr uint64_t kFirstPackBytes = uint64_t{256} << 10;

// A band: the blocks with all tiles whose roots are on `level`, or with all color pages of `level`.
struct PackageBand {
  bool is_color = false;
  uint32_t level = 0;
  uint64_t items = 0;  // number of tiles or color pages
  uint64_t blocks = 0;
  uint64_t head_tiles = 0;  // number of tiles that the first picture needs; 0 for color pages

  // Number of blocks that are stored in the head. They are the first blocks of the band.
  uint64_t head_blocks() const { return (head_tiles + kBlockTiles - 1) / kBlockTiles; }
  // Number of blocks that are stored in packs.
  uint64_t pack_blocks() const { return blocks - head_blocks(); }
};

// A page of the directory. `bytes` is the compressed size of the page. The other members describe
// the first of its blocks: the number of the pack, the offset in the pack, and the code.
struct DirectoryPage {
  uint64_t bytes = 0;
  uint64_t pack = 0;
  uint64_t offset = 0;
  uint64_t code = 0;  // Morton code of the first color page in the block; 0 for tiles
};

struct PackageFile {
  std::string name;
  uint64_t bytes = 0;
  uint64_t blocks = 0;  // number of blocks, if the file is a pack
};

// The head. `lengths` has the compressed sizes of its blocks. They are stored without gaps, in the
// order of the bands.
struct PackageHead {
  std::string name;
  uint64_t bytes = 0;
  std::vector<uint16_t> lengths;
};

struct PackageIndex {
  std::string manifest;  // JSON as in docs/api.md, with kPackageTileLevels as "tile_levels"
  std::vector<PackageBand> bands;  // in the order in which their blocks are stored
  PackageHead head;                // without a name if the package has no head
  PackageFile directory;
  std::vector<DirectoryPage> pages;
  std::vector<PackageFile> packs;
  std::vector<PackageFile> viewer;  // viewer files whose names contain a hash
};

inline constexpr const char* kIndexName = "package.json";
// Maximum size of package.json. It has about 70 bytes for 4096 blocks, and about 70 for each pack.
// Without this limit, a small hostile package could fill the memory: parsed JSON takes many times
// its size.
inline constexpr uint64_t kMaxIndexBytes = uint64_t{8} << 20;

// Returns the text of package.json, in the newest version of the format.
std::string index_text(const PackageIndex& index);
// Versions of package.json. The versions 1 to 3 describe their files alike, but only the blocks of
// version 3 can be read.
enum class PackageVersions { kReadable, kKnown };
// Parses the text of package.json, and checks that its numbers are consistent. Throws
// Error{kCorrupt}, or Error{kUnsupportedVersion} for a version that is not one of `accepted`. Error
// messages begin with `path`.
PackageIndex parse_index(std::string_view text, const std::string& path,
                         PackageVersions accepted = PackageVersions::kReadable);

// Returns the digest of a package: 32 hex digits of the SHA-256 of its manifest, with "" as the
// digest, and of the names of the head, the directory and the packs, which contain hashes.
std::string package_digest(const PackageIndex& index);

// Returns a hash as 16 hex digits.
std::string hash_digits(uint64_t hash);
// Returns the file name `stem`-HASH`suffix`. HASH is the XXH64 of `contents`, as 16 hex digits.
std::string hashed_name(const std::string& stem, std::string_view contents,
                        const std::string& suffix);

}  // namespace voxdag::query
