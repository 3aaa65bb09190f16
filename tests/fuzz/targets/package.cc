// Reads packages (query/package). The first byte of an input selects a decoder:
//
//     0   package.json
//     1   a block of tiles: levels of the grid, level of the tiles, number of tiles, plain bytes
//     2   a block of color pages: plain bytes
//     3   a compressed block
//     4   a complete package of at most kMaxBlocks blocks in its pack and in its head
//
// The sections of a complete package are stored one after the other, each after its size (32 bits):
// package.json, the plain page of the directory, the plain blocks of the head, and the plain blocks
// of the pack. The target compresses page and blocks, and corrects names, sizes and offsets, so
// that a mutation reaches the code after these checks.
#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "query/package/color_block.h"
#include "query/package/gzip_block.h"
#include "query/package/package_reader.h"
#include "query/package/tile_block.h"
#include "tests/fuzz/support/fuzz_target.h"
#include "tests/fuzz/support/memory_folder.h"

namespace voxdag {
namespace {

constexpr size_t kMaxPlainBytes = size_t{1} << 20;
constexpr uint64_t kMaxBlocks = 64;  // maximum number of blocks of a complete package

void read_index(std::string_view text) {
  const query::PackageIndex index = query::parse_index(text, "package.json");
  const std::string again = query::index_text(index);
  fuzz::require(query::index_text(query::parse_index(again, "package.json")) == again,
                "an index that was written is read back");
}

// A decoded block must be encoded to the same bytes.
void read_tiles(std::string_view bytes) {
  if (bytes.size() < 3) return;
  const auto number = [&](size_t at, uint32_t low, uint32_t high) {
    return low + static_cast<unsigned char>(bytes[at]) % (high - low + 1);
  };
  const uint32_t grid_levels = number(0, 3, 20), level = number(1, 0, grid_levels - 3),
                 count = number(2, 1, query::kBlockTiles);
  const std::string_view plain = bytes.substr(3);
  const query::TileBlock block = query::decode_tile_block(plain, grid_levels, level, count);
  query::TileBlockEncoder encoder(block.first);
  for (const auto& tile : block.tiles) encoder.add(tile);
  fuzz::require(encoder.finish() == plain, "a block of tiles is encoded to the same bytes");
}

void read_colors(std::string_view bytes) {
  fuzz::require(query::encode_color_block(query::decode_color_block(bytes)) == bytes,
                "a block of color pages is encoded to the same bytes");
}

void write(const std::string& name, const std::string& contents) {
  std::ofstream(fuzz::memory_folder() + "/" + name, std::ios::binary) << contents;
}

// Takes the next section of a complete package; "" after the last.
std::string take_section(std::string_view& bytes) {
  uint32_t size = 0;
  if (bytes.size() < sizeof size) return "";
  std::memcpy(&size, bytes.data(), sizeof size);
  const std::string section(bytes.substr(sizeof size, size));
  bytes.remove_prefix(std::min(bytes.size(), sizeof size + section.size()));
  return section;
}

// Takes the next `blocks` sections and compresses them as the blocks of one pack. Writes the sizes
// of these blocks to `page`, the plain page of the directory.
std::string make_pack(query::PackageIndex& index, uint64_t blocks, std::string_view& sections,
                      std::string& page) {
  std::string pack;
  for (uint64_t i = 0; i < blocks; ++i) {
    const std::string block = query::gzip_block(take_section(sections));
    const auto size = static_cast<uint16_t>(block.size());
    if (page.size() >= sizeof size * (i + 1))
      std::memcpy(page.data() + sizeof size * i, &size, sizeof size);
    pack += block;
  }
  index.packs = {{query::hashed_name("pack", pack, ".bin"), pack.size(), blocks}};
  return pack;
}

// Takes the next sections and compresses them as the blocks of the head.
std::string make_head(query::PackageIndex& index, std::string_view& sections) {
  std::string head;
  for (uint16_t& length : index.head.lengths) {
    const std::string block = query::gzip_block(take_section(sections));
    length = static_cast<uint16_t>(block.size());
    head += block;
  }
  if (!index.head.name.empty()) {
    index.head.name = query::hashed_name("head", head, ".bin");
    index.head.bytes = head.size();
  }
  return head;
}

// Compresses `page` as the directory.
std::string make_directory(query::PackageIndex& index, const std::string& page) {
  const std::string directory = index.pages.empty() ? "" : query::gzip_block(page);
  for (query::DirectoryPage& entry : index.pages)
    entry = {.bytes = directory.size(), .code = entry.code};
  index.directory = {query::hashed_name("directory", directory, ".bin"), directory.size(), 0};
  return directory;
}

// Reads a tile or a color page of each band, and then checks the package. Errors are allowed.
void read_folder() {
  const query::PackageReader package(system_files(), fuzz::memory_folder());
  for (const query::PackageBand& band : package.index().bands) try {
      if (band.is_color)
        package.color_page(band.level, {0, 0, 0});
      else
        package.tile(band.level, band.items / 2);
    } catch (const Error&) {
    }
  NoProgress progress;
  package.check(progress, CancelToken());
}

void read_package(std::string_view sections) {
  query::PackageIndex index = query::parse_index(take_section(sections), "package.json");
  uint64_t blocks = 0;
  for (const query::PackageBand& band : index.bands) blocks += band.pack_blocks();
  if (blocks > kMaxBlocks || index.head.lengths.size() > kMaxBlocks) return;
  index.viewer.clear();
  std::string page = take_section(sections);
  const std::string head = make_head(index, sections),
                    pack = make_pack(index, blocks, sections, page),
                    directory = make_directory(index, page), pack_name = index.packs[0].name;
  write("package.json", query::index_text(index));
  write(index.directory.name, directory);
  write(pack_name, pack);
  if (!index.head.name.empty()) write(index.head.name, head);
  try {
    read_folder();
  } catch (const Error&) {
  }
  std::filesystem::remove(fuzz::memory_folder() + "/" + index.directory.name);
  std::filesystem::remove(fuzz::memory_folder() + "/" + pack_name);
  if (!index.head.name.empty())
    std::filesystem::remove(fuzz::memory_folder() + "/" + index.head.name);
}

void read(int decoder, std::string_view bytes) {
  switch (decoder) {
    case 0:
      return read_index(bytes);
    case 1:
      return read_tiles(bytes);
    case 2:
      return read_colors(bytes);
    case 3:
      (void)query::gunzip_block(bytes, kMaxPlainBytes);
      return;
    case 4:
      return read_package(bytes);
  }
}

}  // namespace
}  // namespace voxdag

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxdag;
  if (size == 0) return 0;
  try {
    read(data[0], {reinterpret_cast<const char*>(data) + 1, size - 1});
  } catch (const Error& error) {
    fuzz::require(
        error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupportedVersion,
        "a bad package is an error of kind corrupt");
  }
  return 0;
}
