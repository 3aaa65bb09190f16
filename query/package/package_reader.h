// Reads and checks a package (package_index.h). The files can be damaged or malicious, so all sizes
// in them are checked. The memory is about as large as package.json, which is limited to
// kMaxIndexBytes, plus one page of the directory and one block. It does not depend on the sizes of
// the other files. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/io/file_system.h"
#include "query/package/package_index.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

class PackageReader {
 public:
  // Reads the index of the package in `folder`, and checks its directory. Throws Error: kNotFound
  // if the folder has no index; kLimit if the index is too large; kCorrupt; kUnsupportedVersion.
  PackageReader(FileSystem& files, const std::string& folder);

  const PackageIndex& index() const { return index_; }
  // Returns the number L of levels of the grid, which has 2^L voxels per edge.
  uint32_t grid_levels() const { return grid_levels_; }
  // Returns the words of a tile, as encode_tile() returns them, with one difference. A node at
  // which the tile ends is the root of another tile. The words have the number of this other tile
  // instead of the node's word offset. `number` is the number of the requested tile among the tiles
  // whose roots are on `level`. Throws Error{kNotFound} if the package has no such tile, and
  // Error{kCorrupt} if the tile's block is damaged.
  std::vector<uint32_t> tile(uint32_t level, uint64_t number) const;
  // Returns the words of a color page (color_page.h). The result is {0} if no cell of the page is
  // set.
  std::vector<uint32_t> color_page(uint32_t level, const std::array<uint64_t, 3>& position) const;

  // Checks the sizes and hashes of all files of the package, and the contents of all blocks. The
  // name of index.html has no hash, and the user may change the page. So this file only must exist
  // and name the viewer's files. Also checks the bands (the tiles whose roots are on one level):
  // each band must have exactly the tiles to which the band above refers. Throws the Error of the
  // first problem.
  void check(Progress& progress, const CancelToken& cancel) const;

 private:
  // Where a block is stored. `pack` is kHead for a block of the head. `code` is the Morton code of
  // the block's first color page; it is 0 for tiles.
  static constexpr uint64_t kHead = ~uint64_t{0};
  struct Place {
    uint64_t pack = 0;
    uint64_t offset = 0;
    uint64_t bytes = 0;
    uint64_t code = 0;
  };
  // A band, the number of its first block in the packs, and the number of its first block in the
  // head.
  struct PlacedBand {
    PackageBand band;
    uint64_t first = 0;
    uint64_t first_in_head = 0;
  };

  void check_directory();
  // Reads a page of the directory. Returns the places of its blocks.
  std::vector<Place> read_page(uint64_t page) const;
  std::vector<Place> decode_page(uint64_t page, const std::string& compressed) const;
  const Place& place_of(uint64_t block) const;
  // Returns the place of a block of a band. `i` is the number of the block in the band.
  Place place_of(const PlacedBand& band, uint64_t i) const;
  uint64_t count_color_blocks(uint64_t first, uint64_t count) const;
  std::vector<PlacedBand> placed_bands() const;
  PlacedBand find_band(bool is_color, uint32_t level) const;
  std::string block(const PlacedBand& band, uint64_t i) const;
  std::string path_of(const std::string& name) const { return folder_ + "/" + name; }
  std::string path_of(const Place& place) const;
  std::string name_of(const PlacedBand& band, uint64_t i) const;
  void check_file(const PackageFile& file, const CancelToken& cancel) const;
  void check_page() const;
  // Checks that the digest in the manifest is package_digest().
  void check_digest() const;
  uint64_t check_tiles(const PlacedBand& band, uint64_t head_tiles_below, Progress& progress,
                       const CancelToken& cancel) const;
  void check_colors(const PlacedBand& band, Progress& progress, const CancelToken& cancel) const;

  FileSystem& files_;
  const std::string folder_;
  PackageIndex index_;
  uint32_t grid_levels_ = 0;
  uint64_t blocks_ = 0;                // number of blocks in the packs
  std::vector<uint64_t> head_begins_;  // offset of each block of the head
  std::vector<uint64_t> page_begins_;  // offset of each page in the directory
  std::vector<uint64_t> pack_ends_;    // number of the block after the last block of each pack
  // The page of the directory that was read last.
  mutable uint64_t cached_page_ = ~uint64_t{0};
  mutable std::vector<Place> cached_places_;
};

}  // namespace voxdag::query
