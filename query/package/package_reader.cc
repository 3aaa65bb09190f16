#include "query/package/package_reader.h"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <span>

#include "core/base/error.h"
#include "core/dag/brick.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"
#include "core/geometry/cube.h"
#include "core/geometry/morton.h"
#include "query/package/color_block.h"
#include "query/package/gzip_block.h"
#include "query/package/tile_block.h"
#include "query/tiles/tile.h"

namespace voxdag::query {
namespace {

constexpr size_t kPartBytes = size_t{1} << 20;             // files are hashed in parts of this size
constexpr uint64_t kMaxPageHtmlBytes = uint64_t{1} << 24;  // size of index.html
constexpr size_t kMaxBlockBytes = size_t{1} << 20;         // size of a decompressed block
constexpr size_t kDirectoryEntryBytes = 2, kCodeBytes = 8;
// Minimum size of a compressed block: header, trailer, and the data of an empty gzip stream.
constexpr uint64_t kMinBlockBytes = 20;
// Maximum size of a compressed page of the directory. It is larger than any plain page.
constexpr uint64_t kMaxPageBytes = 2 * (kDirectoryEntryBytes + kCodeBytes) * kPageBlocks;

[[noreturn]] void corrupt(const std::string& path, const std::string& what) {
  throw Error(ErrorCode::kCorrupt, path + ": " + what);
}

template <class T>
T number_at(std::string_view bytes, size_t at) {
  T number;
  std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

// Collects the references to the tiles of a band that are in the head.
class HeadReferences {
 public:
  explicit HeadReferences(uint64_t count) : is_referenced_(count, false) {}

  void add(const TileBlock& block) {
    for (const std::vector<uint32_t>& tile : block.tiles) {
      if (has_bricks(tile)) return;
      for (size_t at = leaves_begin(tile); at < tile.size(); at += 4)
        if (tile[at] < is_referenced_.size()) is_referenced_[tile[at]] = true;
    }
  }
  void expect_all(const std::string& path, uint32_t level) const {
    const auto missing = std::ranges::find(is_referenced_, false);
    if (missing != is_referenced_.end())
      corrupt(path, "level " + std::to_string(level) + " has no tile in the head that refers to " +
                        "tile " + std::to_string(missing - is_referenced_.begin()) +
                        " of the band below, which is in the head: expected a reference");
  }

 private:
  std::vector<bool> is_referenced_;  // by number of the tile
};

}  // namespace

PackageReader::PackageReader(FileSystem& files, const std::string& folder)
    : files_(files), folder_(folder) {
  const std::string path = path_of(kIndexName);
  index_ = parse_index(read_small_file(files_, path, kMaxIndexBytes), path);
  const auto manifest = parse_json<nlohmann::json>(index_.manifest);
  const auto levels = manifest.value("levels", nlohmann::json());
  if (!levels.is_number_unsigned() || levels.get<uint64_t>() < kBrickLevels ||
      levels.get<uint64_t>() > uint64_t{kMaxGridLevels})
    corrupt(path, "'levels' of the manifest is " + exact_json_text(levels) +
                      ": expected a whole number from " + std::to_string(kBrickLevels) + " to " +
                      std::to_string(kMaxGridLevels));
  if (manifest.value("tile_levels", nlohmann::json()) != kPackageTileLevels)
    corrupt(path, "'tile_levels' of the manifest is not valid: expected " +
                      std::to_string(kPackageTileLevels));
  grid_levels_ = levels.get<uint32_t>();
  for (const PackageBand& band : index_.bands)
    if (band.is_color ? band.level > grid_levels_ : band.level + kBrickLevels >= grid_levels_)
      corrupt(path, "'bands' has the level " + std::to_string(band.level) +
                        ": expected a level of the grid of " + std::to_string(grid_levels_) +
                        " levels");
  for (const PackageFile& pack : index_.packs) pack_ends_.push_back(blocks_ += pack.blocks);
  uint64_t at = 0;
  for (const DirectoryPage& page : index_.pages) {
    page_begins_.push_back(at);
    at += page.bytes;
  }
  at = 0;
  for (const uint16_t length : index_.head.lengths) {
    head_begins_.push_back(at);
    at += length;
  }
  check_directory();
}

// Reads all pages of the directory, one after the other. Checks that each begins at the block after
// the previous page, as its entry in the index says.
void PackageReader::check_directory() {
  const std::string path = path_of(index_.directory.name);
  const uint64_t bytes = files_.open_read(path)->size();
  if (bytes != index_.directory.bytes)
    corrupt(path, "it has " + std::to_string(bytes) + " bytes: expected " +
                      std::to_string(index_.directory.bytes));
  Place last;
  for (uint64_t page = 0; page < index_.pages.size(); ++page) {
    const std::vector<Place> places = read_page(page);
    const Place& begin = places.front();
    const bool is_same_pack = page > 0 && begin.pack == last.pack;
    const DirectoryPage& entry = index_.pages[page];
    if (begin.offset != (is_same_pack ? last.offset + last.bytes : 0) || begin.pack != entry.pack ||
        begin.code != entry.code)
      corrupt(path, "page " + std::to_string(page) +
                        " begins at another block than its entry in the index says, expected the "
                        "same block");
    last = places.back();
  }
}

uint64_t PackageReader::count_color_blocks(uint64_t first, uint64_t count) const {
  uint64_t colored = 0, begin = 0;
  for (const PackageBand& band : index_.bands) {
    const uint64_t end = begin + band.pack_blocks(), low = std::max(begin, first),
                   high = std::min(end, first + count);
    if (band.is_color && low < high) colored += high - low;
    begin = end;
  }
  return colored;
}

std::vector<PackageReader::Place> PackageReader::read_page(uint64_t page) const {
  const std::string path = path_of(index_.directory.name);
  const DirectoryPage& entry = index_.pages[page];
  if (entry.bytes > kMaxPageBytes)
    corrupt(path, "page " + std::to_string(page) + " has " + std::to_string(entry.bytes) +
                      " bytes, expected at most " + std::to_string(kMaxPageBytes));
  std::string bytes(entry.bytes, '\0');
  files_.open_read(path)->read_at(page_begins_[page], std::as_writable_bytes(std::span(bytes)));
  return naming_file(path, [&] { return decode_page(page, bytes); });
}

std::vector<PackageReader::Place> PackageReader::decode_page(uint64_t page,
                                                             const std::string& compressed) const {
  const uint64_t first = page * kPageBlocks, count = std::min(kPageBlocks, blocks_ - first),
                 colored = count_color_blocks(first, count);
  const uint64_t expected = kDirectoryEntryBytes * count + kCodeBytes * colored;
  const std::string plain = gunzip_block(compressed, kMaxPageBytes);
  if (plain.size() != expected)
    throw Error(ErrorCode::kCorrupt,
                "page " + std::to_string(page) + " has " + std::to_string(plain.size()) +
                    " bytes after decompression, expected " + std::to_string(expected) +
                    ", the bytes of " + std::to_string(count) + " entries");
  size_t low = kDirectoryEntryBytes * count, high = low + 4 * colored;
  auto pack =
      static_cast<uint64_t>(std::ranges::upper_bound(pack_ends_, first) - pack_ends_.begin());
  uint64_t offset = index_.pages[page].offset;
  size_t band = 0;
  uint64_t band_end = index_.bands[0].pack_blocks();
  std::vector<Place> places;
  places.reserve(count);
  for (uint64_t i = 0; i < count; ++i) {
    const uint64_t block = first + i;
    if (block == pack_ends_[pack]) {
      ++pack;
      offset = 0;
    }
    while (block >= band_end) band_end += index_.bands[++band].pack_blocks();
    Place place{pack, offset, number_at<uint16_t>(plain, kDirectoryEntryBytes * i), 0};
    if (index_.bands[band].is_color) {
      place.code = number_at<uint32_t>(plain, low) | uint64_t{number_at<uint32_t>(plain, high)}
                                                         << 32;
      low += 4;
      high += 4;
    }
    if (place.bytes < kMinBlockBytes)
      throw Error(ErrorCode::kCorrupt, "block " + std::to_string(block) + " has " +
                                           std::to_string(place.bytes) + " bytes, expected " +
                                           std::to_string(kMinBlockBytes) + " or more");
    offset += place.bytes;
    if (offset > index_.packs[pack].bytes)
      throw Error(ErrorCode::kCorrupt, "block " + std::to_string(block) +
                                           " ends after its pack, expected an end within the " +
                                           std::to_string(index_.packs[pack].bytes) +
                                           " bytes of the pack");
    places.push_back(place);
  }
  return places;
}

const PackageReader::Place& PackageReader::place_of(uint64_t block) const {
  const uint64_t page = block / kPageBlocks;
  if (page != cached_page_) {
    cached_places_ = read_page(page);
    cached_page_ = page;
  }
  return cached_places_[block % kPageBlocks];
}

PackageReader::Place PackageReader::place_of(const PlacedBand& band, uint64_t i) const {
  const uint64_t in_head = band.band.head_blocks();
  if (i >= in_head) return place_of(band.first + i - in_head);
  const uint64_t at = band.first_in_head + i;
  return {kHead, head_begins_[at], index_.head.lengths[at], 0};
}

std::vector<PackageReader::PlacedBand> PackageReader::placed_bands() const {
  std::vector<PlacedBand> bands;
  uint64_t first = 0, first_in_head = 0;
  for (const PackageBand& band : index_.bands) {
    bands.push_back({band, first, first_in_head});
    first += band.pack_blocks();
    first_in_head += band.head_blocks();
  }
  return bands;
}

PackageReader::PlacedBand PackageReader::find_band(bool is_color, uint32_t level) const {
  for (const PlacedBand& placed : placed_bands())
    if (placed.band.is_color == is_color && placed.band.level == level) return placed;
  throw Error(ErrorCode::kNotFound,
              folder_ + ": level " + std::to_string(level) +
                  (is_color ? " has no color pages: expected a level with colors"
                            : " has no tiles: expected a level with tiles"));
}

std::string PackageReader::path_of(const Place& place) const {
  return path_of(place.pack == kHead ? index_.head.name : index_.packs[place.pack].name);
}

std::string PackageReader::name_of(const PlacedBand& band, uint64_t i) const {
  return path_of(place_of(band, i)) + ": block " + std::to_string(i) + " of level " +
         std::to_string(band.band.level);
}

std::string PackageReader::block(const PlacedBand& band, uint64_t i) const {
  const Place place = place_of(band, i);
  const auto file = files_.open_read(path_of(place));
  std::string bytes(place.bytes, '\0');
  file->read_at(place.offset, std::as_writable_bytes(std::span(bytes.data(), bytes.size())));
  return naming_file(name_of(band, i), [&] { return gunzip_block(bytes, kMaxBlockBytes); });
}

std::vector<uint32_t> PackageReader::tile(uint32_t level, uint64_t number) const {
  const PlacedBand band = find_band(false, level);
  if (number >= band.band.items)
    throw Error(ErrorCode::kNotFound, folder_ + ": tile " + std::to_string(number) + " of level " +
                                          std::to_string(level) +
                                          " does not exist: expected a number below " +
                                          std::to_string(band.band.items));
  const uint64_t i = number / kBlockTiles,
                 count = std::min<uint64_t>(kBlockTiles, band.band.items - i * kBlockTiles);
  const std::string bytes = block(band, i);
  return naming_file(name_of(band, i), [&] {
    return decode_tile_block(bytes, grid_levels_, level, static_cast<uint32_t>(count))
        .tiles[number % kBlockTiles];
  });
}

std::vector<uint32_t> PackageReader::color_page(uint32_t level,
                                                const std::array<uint64_t, 3>& position) const {
  const PlacedBand band = find_band(true, level);
  const uint64_t code =
      morton_encode(static_cast<uint32_t>(position[0]), static_cast<uint32_t>(position[1]),
                    static_cast<uint32_t>(position[2]));
  if (band.band.blocks == 0) return {0};
  const uint64_t end = band.first + band.band.blocks;
  uint64_t at = band.first;
  // First skips complete pages of the directory.
  for (uint64_t page = at / kPageBlocks + 1;
       page * kPageBlocks < end && index_.pages[page].code <= code; ++page)
    at = page * kPageBlocks;
  while (at + 1 < end && place_of(at + 1).code <= code) ++at;
  const uint64_t i = at - band.first;
  const std::string bytes = block(band, i);
  for (CodedPage& page : naming_file(name_of(band, i), [&] { return decode_color_block(bytes); }))
    if (page.code == code) return std::move(page.words);
  return {0};
}

void PackageReader::check_file(const PackageFile& file, const CancelToken& cancel) const {
  const std::string path = path_of(file.name);
  const auto opened = files_.open_read(path);
  if (opened->size() != file.bytes)
    corrupt(path, "it has " + std::to_string(opened->size()) + " bytes: expected " +
                      std::to_string(file.bytes));
  Checksum64 checksum;
  std::vector<std::byte> part(std::min<uint64_t>(kPartBytes, file.bytes));
  for (uint64_t at = 0; at < file.bytes; at += part.size()) {
    cancel.check();
    part.resize(std::min<uint64_t>(kPartBytes, file.bytes - at));
    opened->read_at(at, part);
    checksum.add(part);
  }
  const std::string hash = hash_digits(checksum.value());
  if (file.name.find("-" + hash + ".") == std::string::npos)
    corrupt(path, "its contents have the hash " + hash + ": expected the hash in its name");
}

// Checks the tiles of a band. The first `head_tiles_below` tiles of the band below are in the head,
// so tiles of this band in the head must refer to all of them. Returns the number of tiles to which
// this band refers.
uint64_t PackageReader::check_tiles(const PlacedBand& band, uint64_t head_tiles_below,
                                    Progress& progress, const CancelToken& cancel) const {
  auto next = static_cast<uint32_t>(head_tiles_below);
  HeadReferences references(head_tiles_below);
  for (uint64_t i = 0; i < band.band.blocks; ++i) {
    cancel.check();
    const std::string bytes = block(band, i);
    naming_file(name_of(band, i), [&] {
      const uint64_t count = std::min<uint64_t>(kBlockTiles, band.band.items - i * kBlockTiles);
      const TileBlock tiles =
          decode_tile_block(bytes, grid_levels_, band.band.level, static_cast<uint32_t>(count));
      if (tiles.first != next)
        throw Error(ErrorCode::kCorrupt, "its first new tile has the number " +
                                             std::to_string(tiles.first) + ", expected " +
                                             std::to_string(next) +
                                             ", which follows the tiles of the blocks before it");
      next = tiles.next;
      if (i < band.band.head_blocks()) references.add(tiles);
    });
    progress.advance(1);
  }
  references.expect_all(path_of(kIndexName), band.band.level);
  return next;
}

void PackageReader::check_colors(const PlacedBand& band, Progress& progress,
                                 const CancelToken& cancel) const {
  uint64_t count = 0, last = 0;
  for (uint64_t i = 0; i < band.band.blocks; ++i) {
    cancel.check();
    const std::string bytes = block(band, i);
    naming_file(name_of(band, i), [&] {
      const std::vector<CodedPage> pages = decode_color_block(bytes);
      const uint64_t code = pages[0].code, expected = place_of(band, i).code;
      if (code != expected)
        throw Error(ErrorCode::kCorrupt, "its first color page has the Morton code " +
                                             std::to_string(code) + ", expected " +
                                             std::to_string(expected) + " as in the directory");
      if (count > 0 && code <= last)
        throw Error(ErrorCode::kCorrupt, "its first color page has the Morton code " +
                                             std::to_string(code) + ", expected more than " +
                                             std::to_string(last) +
                                             ", the last code of the block before it");
      last = pages.back().code;
      count += pages.size();
    });
    progress.advance(1);
  }
  if (count != band.band.items)
    corrupt(path_of(kIndexName), "level " + std::to_string(band.band.level) + " has " +
                                     std::to_string(count) + " color pages: expected " +
                                     std::to_string(band.band.items));
}

// Checks that index.html names the viewer's files. Does not expect the poster, because a user who
// changes the page can remove it.
void PackageReader::check_page() const {
  const std::string path = path_of("index.html");
  const std::string page = read_small_file(files_, path, kMaxPageHtmlBytes);
  for (const PackageFile& file : index_.viewer)
    if (!file.name.starts_with("poster-") && page.find(file.name) == std::string::npos)
      corrupt(path, "it does not name the file " + file.name +
                        " of the viewer: expected the page that was published with this package");
}

void PackageReader::check_digest() const {
  const auto manifest = parse_json<nlohmann::json>(index_.manifest);
  const auto digest = manifest.value("digest", nlohmann::json());
  const std::string expected = package_digest(index_);
  if (digest != expected)
    corrupt(path_of(kIndexName), "'digest' of the manifest is " + exact_json_text(digest) +
                                     ": expected \"" + expected +
                                     "\", the digest of the manifest and of the file names");
}

void PackageReader::check(Progress& progress, const CancelToken& cancel) const {
  progress.begin_stage("check", blocks_ + index_.head.lengths.size(), "blocks");
  check_file(index_.directory, cancel);
  if (!index_.head.name.empty()) check_file({index_.head.name, index_.head.bytes, 0}, cancel);
  for (const PackageFile& file : index_.viewer) check_file(file, cancel);
  if (!index_.viewer.empty()) check_page();
  for (const PackageFile& pack : index_.packs) check_file(pack, cancel);
  const std::vector<PlacedBand> bands = placed_bands();
  uint64_t expected = 1;
  for (auto placed = bands.begin(); placed != bands.end(); ++placed) {
    const PackageBand& band = placed->band;
    if (band.is_color) {
      check_colors(*placed, progress, cancel);
      continue;
    }
    if (band.items != expected)
      corrupt(path_of(kIndexName), "level " + std::to_string(band.level) + " has " +
                                       std::to_string(band.items) + " tiles: expected " +
                                       std::to_string(expected) +
                                       ", the number of references to them");
    const auto below = std::find_if(placed + 1, bands.end(),
                                    [](const PlacedBand& each) { return !each.band.is_color; });
    expected =
        check_tiles(*placed, below == bands.end() ? 0 : below->band.head_tiles, progress, cancel);
  }
  const bool has_tiles =
      std::ranges::any_of(bands, [](const PlacedBand& placed) { return !placed.band.is_color; });
  if (has_tiles && expected != 0)
    corrupt(path_of(kIndexName), "the finest tiles refer to " + std::to_string(expected) +
                                     " tiles of another band: expected the band with these tiles");
  check_digest();
  progress.end_stage();
}

}  // namespace voxdag::query
