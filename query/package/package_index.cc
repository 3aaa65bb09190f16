#include "query/package/package_index.h"

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <span>

#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "core/format/checksum.h"
#include "core/geometry/cube.h"

namespace voxdag::query {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "voxdag package";
constexpr size_t kDigestDigits = 32;
constexpr uint64_t kVersion = 3;
// Maximum depth of nested values in package.json. Formatting nested JSON recurses, so a greater
// depth could overflow the stack.
constexpr int kMaxDepth = 32;
constexpr size_t kMaxBands = 2 * (size_t{kMaxGridLevels} + 1);
constexpr uint64_t kMaxNumber = uint64_t{1} << 53;  // integers up to this are exact in JavaScript

Json file_json(const PackageFile& file, bool is_pack) {
  Json json = {{"name", file.name}, {"bytes", file.bytes}};
  if (is_pack) json["blocks"] = file.blocks;
  return json;
}

// True if the file name `name` cannot lead out of the folder of the package, and is not
// package.json or index.html, the two names without a hash. An update of a package removes files by
// the names in package.json. Anyone could have written that file.
bool is_safe_name(const std::string& name) {
  if (name == kIndexName || name == "index.html") return false;
  if (name.empty() || name[0] == '/' || name[0] == '.') return false;
  if (name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789-./") != name.npos) return false;
  return name.find("..") == name.npos && name.find("//") == name.npos;
}

class Parser {
 public:
  Parser(const std::string& path, PackageVersions accepted) : path_(path), accepted_(accepted) {}

  PackageIndex parse(std::string_view text) const {
    bool is_too_deep = false;
    const auto limit_depth = [&](int depth, Json::parse_event_t, Json&) {
      is_too_deep |= depth > kMaxDepth;
      return depth <= kMaxDepth;
    };
    const Json json = Json::parse(text, limit_depth, false);
    expect(!is_too_deep, "the text", "a depth of at most " + std::to_string(kMaxDepth));
    expect(json.is_object() && json.value("format", Json()) == kFormat, "'format'",
           std::string("'") + kFormat + "'");
    const Json version = json.value("version", Json());
    const bool is_older = version == 1 || version == 2;
    if (version != kVersion && !(is_older && accepted_ == PackageVersions::kKnown))
      throw Error(ErrorCode::kUnsupportedVersion,
                  path_ + ": it has version " + exact_json_text(version) +
                      " of the format, expected version " + std::to_string(kVersion) +
                      (is_older ? "; publish the file again" : ""));
    PackageIndex index;
    const Json& manifest = member(json, "manifest");
    expect(manifest.is_object(), "'manifest'", "an object");
    index.manifest = exact_json_text(manifest);
    for (const Json& band : list(json, "bands")) index.bands.push_back(band_of(band));
    expect(index.bands.size() <= kMaxBands, "'bands'", "at most two bands of each level");
    if (json.contains("head")) index.head = head_of(json["head"]);
    const Json& directory = member(json, "directory");
    index.directory = file_of(directory);
    for (const Json& page : list(directory, "pages"))
      index.pages.push_back({.bytes = number(page, "bytes"),
                             .pack = number(page, "pack"),
                             .offset = number(page, "offset"),
                             .code = number(page, "code")});
    for (const Json& pack : list(json, "packs")) {
      index.packs.push_back(file_of(pack));
      index.packs.back().blocks = number(pack, "blocks");
    }
    for (const Json& file : list(json, "viewer")) index.viewer.push_back(file_of(file));
    check_sums(index);
    return index;
  }

 private:
  void expect(bool is_true, const std::string& what, const std::string& expected) const {
    if (!is_true) throw Error(ErrorCode::kCorrupt, path_ + ": " + what + ": expected " + expected);
  }
  const Json& member(const Json& json, const char* name) const {
    expect(json.is_object() && json.contains(name), std::string("'") + name + "'", "a value");
    return json[name];
  }
  const Json& list(const Json& json, const char* name) const {
    const Json& value = member(json, name);
    expect(value.is_array(), std::string("'") + name + "'", "a list");
    return value;
  }
  uint64_t number(const Json& json, const char* name) const {
    const Json& value = member(json, name);
    expect(value.is_number_unsigned() && value.get<uint64_t>() <= kMaxNumber,
           std::string("'") + name + "'", "a whole number up to 2^53");
    return value.get<uint64_t>();
  }
  PackageFile file_of(const Json& json) const {
    const Json& name = member(json, "name");
    expect(name.is_string() && is_safe_name(name.get<std::string>()), "'name'",
           "the name of a file in the package");
    return {name.get<std::string>(), number(json, "bytes"), 0};
  }
  PackageBand band_of(const Json& json) const {
    expect(json.is_object(), "'bands'", "a list of objects");
    PackageBand band;
    band.is_color = json.contains("pages");
    const uint64_t level = number(json, "level");
    expect(level <= uint64_t{kMaxGridLevels}, "'level'", "a level of the grid");
    band.level = static_cast<uint32_t>(level);
    band.items = number(json, band.is_color ? "pages" : "tiles");
    band.blocks = number(json, "blocks");
    if (json.contains("head_tiles")) {
      band.head_tiles = number(json, "head_tiles");
      expect(!band.is_color && band.head_tiles <= band.items, "'head_tiles'",
             "at most the number of tiles of the band");
    }
    expect(band.is_color ? band.blocks <= band.items
                         : band.blocks == (band.items + kBlockTiles - 1) / kBlockTiles,
           "'blocks'", "the number of blocks of a band");
    return band;
  }
  PackageHead head_of(const Json& json) const {
    const PackageFile file = file_of(json);
    PackageHead head{file.name, file.bytes, {}};
    for (const Json& length : list(json, "blocks")) {
      expect(length.is_number_unsigned() && length.get<uint64_t>() <= UINT16_MAX, "'blocks'",
             "a list of block sizes of at most 65535 bytes");
      head.lengths.push_back(length.get<uint16_t>());
    }
    return head;
  }
  // Adds `blocks` to `sum`, which must remain at most kMaxNumber. Without this limit, the sum of
  // many packs could wrap around.
  void add_blocks(uint64_t blocks, uint64_t& sum) const {
    expect(blocks <= kMaxNumber - sum, "'blocks'", "a sum of at most 2^53");
    sum += blocks;
  }
  void check_sums(const PackageIndex& index) const {
    uint64_t of_bands = 0, of_packs = 0, of_pages = 0, of_head = 0, head_bytes = 0;
    for (const PackageBand& band : index.bands) {
      add_blocks(band.pack_blocks(), of_bands);
      add_blocks(band.head_blocks(), of_head);
    }
    for (const uint16_t length : index.head.lengths) head_bytes += length;
    expect(index.head.lengths.size() <= kMaxHeadBlocks, "'head'",
           "at most " + std::to_string(kMaxHeadBlocks) + " blocks");
    expect(of_head == index.head.lengths.size(), "'head'",
           "the sizes of the blocks that the bands have in the head");
    expect(head_bytes == index.head.bytes, "'head'", "the sum of the sizes of its blocks");
    for (const PackageFile& pack : index.packs) {
      expect(pack.blocks > 0, "'blocks'", "at least one block in each pack");
      add_blocks(pack.blocks, of_packs);
    }
    for (const DirectoryPage& page : index.pages) {
      expect(page.bytes <= index.directory.bytes - of_pages, "'pages'",
             "the sizes of the directory's pages");
      of_pages += page.bytes;
      expect(page.pack < index.packs.size(), "'pack'", "the number of a pack");
    }
    expect(of_bands == of_packs, "'blocks'", "the same sum for bands and for packs");
    expect(of_pages == index.directory.bytes, "'pages'", "the sizes of the directory's pages");
    expect(index.pages.size() == (of_bands + kPageBlocks - 1) / kPageBlocks, "'pages'",
           "a page for " + std::to_string(kPageBlocks) + " blocks");
  }

  const std::string& path_;
  const PackageVersions accepted_;
};

}  // namespace

std::string index_text(const PackageIndex& index) {
  Json bands = Json::array(), pages = Json::array(), packs = Json::array(), viewer = Json::array();
  for (const PackageBand& band : index.bands) {
    bands.push_back({{"level", band.level},
                     {band.is_color ? "pages" : "tiles", band.items},
                     {"blocks", band.blocks}});
    if (band.head_tiles > 0) bands.back()["head_tiles"] = band.head_tiles;
  }
  for (const DirectoryPage& page : index.pages)
    pages.push_back(
        {{"bytes", page.bytes}, {"pack", page.pack}, {"offset", page.offset}, {"code", page.code}});
  for (const PackageFile& pack : index.packs) packs.push_back(file_json(pack, true));
  for (const PackageFile& file : index.viewer) viewer.push_back(file_json(file, false));
  Json directory = file_json(index.directory, false);
  directory["pages"] = std::move(pages);
  Json json = {{"format", kFormat},
               {"version", kVersion},
               {"manifest", parse_json<Json>(index.manifest)},
               {"bands", std::move(bands)}};
  if (!index.head.name.empty())
    json["head"] = {
        {"name", index.head.name}, {"bytes", index.head.bytes}, {"blocks", index.head.lengths}};
  json["directory"] = std::move(directory);
  json["packs"] = std::move(packs);
  json["viewer"] = std::move(viewer);
  return exact_json_text(json) + "\n";
}

PackageIndex parse_index(std::string_view text, const std::string& path, PackageVersions accepted) {
  return Parser(path, accepted).parse(text);
}

std::string package_digest(const PackageIndex& index) {
  auto manifest = parse_json<Json>(index.manifest);
  manifest["digest"] = "";
  std::string text = exact_json_text(manifest) + index.head.name + index.directory.name;
  for (const PackageFile& pack : index.packs) text += pack.name;
  return sha256_hex(text).substr(0, kDigestDigits);
}

std::string hash_digits(uint64_t hash) {
  std::array<char, 17> digits;
  std::snprintf(digits.data(), digits.size(), "%016llx", static_cast<unsigned long long>(hash));
  return digits.data();
}

std::string hashed_name(const std::string& stem, std::string_view contents,
                        const std::string& suffix) {
  return stem + "-" +
         hash_digits(checksum64(std::as_bytes(std::span(contents.data(), contents.size())))) +
         suffix;
}

}  // namespace voxdag::query
