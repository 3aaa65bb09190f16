#include "query/package/write_package.h"

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/base/process_limits.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/package/color_bands.h"
#include "query/package/first_tiles.h"
#include "query/package/gzip_block.h"
#include "query/package/pack_writer.h"
#include "query/package/package_folder.h"
#include "query/package/tile_block.h"
#include "query/package/tile_numbers.h"
#include "query/tiles/tile.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kWindowBlocks = 64;  // blocks that are encoded concurrently
constexpr uint64_t kRootsShare = 16;    // a list of roots may use 1/16 of the memory
constexpr uint64_t kReadBytes = uint64_t{1} << 20;

// Writes the bands of tiles and color pages of a file, from coarse to fine.
class BandWriter {
 public:
  BandWriter(const voxdag_reader::File& file, const PackageSpec& spec, const SpillSpace& space,
             PackWriter& packs, Progress& progress, const CancelToken& cancel)
      : file_(file),
        dag_(file),
        blocks_(file),
        spec_(spec),
        space_(space),
        packs_(packs),
        progress_(progress),
        cancel_(cancel),
        colors_(file, dag_, blocks_, packs, cancel) {}

  void run() {
    if (dag_.empty()) return;
    first_.resize(dag_.grid_levels());
    if (spec_.camera) first_ = find_first_tiles(dag_, *spec_.camera, cancel_);
    const uint32_t bricks = dag_.grid_levels() - kBrickLevels;
    progress_.begin_stage("tiles", tile_count(), "tiles");
    SpillList<uint64_t> root(space_);
    root.add(0);
    root.finish();
    std::unique_ptr<TileNumbers> numbers;
    const SpillList<uint64_t>* roots = &root;
    head_tiles_ = first_[0].size();
    for (uint32_t level = 0; level < bricks; level = end_of(level)) {
      auto next = write_band(level, *roots);
      numbers = std::move(next);  // releases the numbers of the band above
      if (numbers) roots = &numbers->offsets();
      // The coarse bricks of these tiles have cells two levels below the level at which the tiles
      // end. The colors of these cells follow the tiles.
      if (spec_.colors) colors_.write_levels(end_of(level) + kBrickLevels);
    }
    if (spec_.colors) colors_.write_levels(dag_.grid_levels());
    progress_.end_stage();
  }
  uint64_t tiles() const { return tiles_; }
  uint64_t color_pages() const { return colors_.pages(); }

 private:
  using Tiles = std::vector<std::vector<uint32_t>>;

  uint32_t end_of(uint32_t level) const {
    return tile_end(dag_.grid_levels(), kPackageTileLevels, level);
  }
  uint64_t tile_count() const {
    uint64_t count = 0;
    for (uint32_t level = 0; level + kBrickLevels < dag_.grid_levels(); level = end_of(level))
      count += file_.level(level).node_count;
    return count;
  }

  // Writes the tiles whose roots are on `level`, at the word offsets `roots`. Returns the numbers
  // of the tiles below them; null if the tiles end with bricks.
  std::unique_ptr<TileNumbers> write_band(uint32_t level, const SpillList<uint64_t>& roots) {
    const uint32_t end = end_of(level);
    std::unique_ptr<TileNumbers> below;
    if (end + kBrickLevels < dag_.grid_levels())
      below = std::make_unique<TileNumbers>(file_, end, spec_.threads, space_, cancel_);
    packs_.begin_band(false, level);
    if (below) number_first(level, end, roots, *below);
    const uint64_t head_below = below ? below->count() : 0;
    SpillReader<uint64_t> reader(roots);
    for (uint64_t number = 0; !reader.at_end(); number += kWindowBlocks * kBlockTiles) {
      write_window(level, number, take_roots(reader), below.get());
      cancel_.check();
      if (resident_bytes() > spec_.memory_bytes) file_.release_pages();
    }
    if (below) below->offsets().finish();
    head_tiles_ = head_below;
    return below;
  }

  // Gives the lowest numbers of the band below, whose tiles have their roots on `end`, to its tiles
  // of the first picture. Only tiles of the first picture refer to them for the first time.
  void number_first(uint32_t level, uint32_t end, const SpillList<uint64_t>& roots,
                    TileNumbers& below) const {
    SpillReader<uint64_t> reader(roots);
    for (uint64_t i = 0; i < head_tiles_; ++i, reader.pop()) {
      const auto tile = encode_tile(dag_, kPackageTileLevels, {level, reader.front()}, &blocks_);
      for (size_t at = leaves_begin(tile); at < tile.size(); at += 4) {
        const uint64_t offset = tile[at] | uint64_t{tile[at + 1]} << 32;
        if (first_[end].contains(offset)) below.number(offset);
      }
    }
  }

  static std::vector<uint64_t> take_roots(SpillReader<uint64_t>& reader) {
    std::vector<uint64_t> offsets;
    for (; !reader.at_end() && offsets.size() < kWindowBlocks * kBlockTiles; reader.pop())
      offsets.push_back(reader.front());
    return offsets;
  }

  // Writes the tiles with the roots `offsets`. `first` is the number of the first of them.
  void write_window(uint32_t level, uint64_t first, const std::vector<uint64_t>& offsets,
                    TileNumbers* below) {
    const size_t count = (offsets.size() + kBlockTiles - 1) / kBlockTiles;
    std::vector<Tiles> tiles(count);
    std::vector<uint32_t> next(count, 0);
    std::vector<std::string> blocks(count);
    const auto end_of_block = [&](size_t block) {
      return std::min<size_t>(offsets.size(), (block + 1) * kBlockTiles);
    };
    parallel_for(spec_.threads, count, [&](unsigned, size_t block) {
      for (size_t i = block * kBlockTiles; i < end_of_block(block); ++i)
        tiles[block].push_back(
            encode_tile(dag_, kPackageTileLevels, {level, offsets[i]}, &blocks_));
    });
    if (below)
      for (size_t block = 0; block < count; ++block) {
        next[block] = below->count();
        for (std::vector<uint32_t>& tile : tiles[block]) number_leaves(tile, *below);
      }
    parallel_for(spec_.threads, count, [&](unsigned, size_t block) {
      TileBlockEncoder encoder(next[block]);
      for (const std::vector<uint32_t>& tile : tiles[block]) encoder.add(tile);
      blocks[block] = gzip_block(encoder.finish());
    });
    for (size_t block = 0; block < count; ++block) {
      const uint64_t number = first + block * kBlockTiles;
      if (number < head_tiles_)
        packs_.add_head_block(blocks[block], tiles[block].size(),
                              std::min<uint64_t>(kBlockTiles, head_tiles_ - number));
      else
        packs_.add_block(blocks[block], tiles[block].size(), 0);
    }
    tiles_ += offsets.size();
    progress_.advance(offsets.size());
  }

  // Replaces the word offset of each cut-off node by the number of the tile that begins there.
  static void number_leaves(std::vector<uint32_t>& tile, TileNumbers& below) {
    for (size_t at = leaves_begin(tile); at < tile.size(); at += 4) {
      tile[at] = below.number(tile[at] | uint64_t{tile[at + 1]} << 32);
      tile[at + 1] = 0;
    }
  }

  const voxdag_reader::File& file_;
  const DagView dag_;
  const CheckedBlocks blocks_;
  const PackageSpec& spec_;
  const SpillSpace& space_;
  PackWriter& packs_;
  Progress& progress_;
  const CancelToken& cancel_;
  ColorBands colors_;
  FirstTiles first_;  // the tiles of the first picture
  // Number of these tiles in the current band. They have its first numbers.
  uint64_t head_tiles_ = 0;
  uint64_t tiles_ = 0;
};

void write_file(FileSystem& files, const std::string& path, std::string_view contents) {
  const auto out = files.create(path);
  out->write_at(0, std::as_bytes(std::span(contents.data(), contents.size())));
  out->sync();
  out->close();
}

// Sets the manifest of the index: spec.manifest with the digest added and, if no colors were
// written, with the member "colors" removed.
void complete_manifest(const PackageSpec& spec, PackageIndex& index) {
  auto manifest = parse_json<nlohmann::ordered_json>(spec.manifest);
  if (!spec.colors) manifest.erase("colors");
  manifest["digest"] = "";
  index.manifest = exact_json_text(manifest);
  manifest["digest"] = package_digest(index);
  index.manifest = exact_json_text(manifest);
}

PackageReport report_of(const PackageIndex& index) {
  PackageReport report;
  report.packs = index.packs.size();
  report.bytes = index.head.bytes + index.directory.bytes;
  for (const PackageFile& pack : index.packs) report.bytes += pack.bytes;
  for (const PackageBand& band : index.bands) report.blocks += band.blocks;
  report.digest = parse_json<nlohmann::ordered_json>(index.manifest)["digest"];
  return report;
}

}  // namespace

PackageReport write_package(const voxdag_reader::File& file, const PackageSpec& spec,
                            const ViewerMaker& make_viewer, FileSystem& files, Progress& progress,
                            const CancelToken& cancel) {
  const WatchedFile watched(file);
  const auto run = [&] {
    PackageFolder folder(files, spec.output);
    const std::vector<ViewerFile> viewer = make_viewer ? make_viewer() : std::vector<ViewerFile>();
    MemoryBudget budget(spec.memory_bytes);
    ScratchFolder scratch(files, folder.scratch());
    const uint64_t list_bytes = std::min(spec.memory_bytes / kRootsShare, spec.list_bytes);
    const SpillSpace space{scratch, budget, list_bytes, list_bytes,
                           std::min(kReadBytes, list_bytes)};
    PackWriter packs(files, folder.new_files(), spec.pack_bytes);
    BandWriter bands(file, spec, space, packs, progress, cancel);
    bands.run();
    PackageIndex index = packs.finish();
    complete_manifest(spec, index);
    uint64_t bytes = 0;
    for (const ViewerFile& page : viewer) {
      write_file(files, folder.new_files() + "/" + page.name, page.contents);
      if (page.name != "index.html") index.viewer.push_back({page.name, page.contents.size(), 0});
      bytes += page.contents.size();
    }
    const std::string text = index_text(index);
    if (text.size() > kMaxIndexBytes)
      throw Error(ErrorCode::kLimit, spec.output + ": its index would have " +
                                         std::to_string(text.size()) + " bytes, expected at most " +
                                         std::to_string(kMaxIndexBytes) + ": use larger packs");
    write_file(files, folder.new_files() + "/" + kIndexName, text);
    watched.check_readable();
    folder.publish(index);
    PackageReport report = report_of(index);
    report.bytes += bytes + text.size();
    report.files = index.packs.size() + 2 + viewer.size() + (index.head.name.empty() ? 0 : 1);
    report.tiles = bands.tiles();
    report.color_pages = bands.color_pages();
    return report;
  };
  return watched.run([&] { return with_reader_errors(run); });
}

}  // namespace voxdag::query
