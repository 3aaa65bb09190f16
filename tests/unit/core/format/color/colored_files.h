// Scenes with colors, global files of these scenes, and a decoder of the color section that was
// written only from docs/format.md.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/color/blocks/region.h"
#include "core/format/checksum.h"
#include "core/format/color/attribute_section_writer.h"
#include "core/geometry/morton.h"
#include "tests/oracle/dag.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {

using Codes = std::vector<uint64_t>;

// A function that returns the color sum of the surfaces in a cell of the color grid. `code` is the
// cell's Morton code.
using SumOf = std::function<ColorSum(uint64_t code)>;

struct ColoredScene {
  uint32_t levels = 0, color_levels = 0;
  Codes voxels;  // Morton codes, increasing
  SumOf sum_of;

  // Returns the Morton codes of a level's cells that contain voxels, in increasing order.
  Codes cells(uint32_t level) const {
    Codes codes;
    for (const uint64_t voxel : voxels)
      if (const uint64_t code = voxel >> 3 * (levels - level);
          codes.empty() || codes.back() != code)
        codes.push_back(code);
    return codes;
  }
};

inline ColorSum sum_of_color(int r, int g, int b, uint64_t weight) {
  ColorSum sum;
  const uint64_t rgb[3] = {uint64_t(r) * 257, uint64_t(g) * 257, uint64_t(b) * 257};
  for (size_t c = 0; c < 3; ++c) {
    sum.plain[c] = weight * rgb[c];
    sum.seen[c] = weight * 255 * rgb[c];
  }
  sum.weight = weight;
  sum.seen_weight = weight * 255;
  return sum;
}

// Returns colors that change smoothly over the grid, with some noise.
inline SumOf smooth_colors(uint32_t color_levels, int noise) {
  return [=](uint64_t code) {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    oracle::Random random(code);
    const auto channel = [&](uint32_t v) {
      const auto value = static_cast<int64_t>(uint64_t{v} * 255 >> color_levels);
      return static_cast<int>(std::clamp<int64_t>(value + random.between(-noise, noise), 0, 255));
    };
    // Named variables fix the order of the calls of channel(): compilers may evaluate the arguments
    // of a call in any order.
    const int r = channel(x), g = channel(y), b = channel(z);
    return sum_of_color(r, g, b, 1 + code % 7);
  };
}

// Returns at least `count` voxels in a grid of any size: the voxels of random walks, each of at
// most 200 steps.
inline Codes random_codes(uint64_t seed, uint32_t levels, int count) {
  oracle::Random random(seed);
  std::set<uint64_t> codes;
  const int64_t edge = int64_t{1} << levels;
  while (static_cast<int>(codes.size()) < count) {
    int64_t at[3];
    for (int64_t& a : at) a = random.between(0, edge - 1);
    const int64_t length = random.between(1, 200);
    for (int64_t i = 0; i < length; ++i) {
      codes.insert(morton_encode(static_cast<uint32_t>(at[0]), static_cast<uint32_t>(at[1]),
                                 static_cast<uint32_t>(at[2])));
      const auto axis = static_cast<size_t>(random.between(0, 2));
      at[axis] = std::clamp<int64_t>(at[axis] + random.between(-1, 1), 0, edge - 1);
    }
  }
  return {codes.begin(), codes.end()};
}

// Returns the DAG of voxels in a grid that may be too large for oracle::build_dag().
inline oracle::Dag sparse_dag(const Codes& voxels, uint32_t levels) {
  oracle::Dag dag;
  if (voxels.empty()) return dag;
  dag.voxels = voxels.size();
  std::map<uint64_t, uint64_t> masks;  // masks of the bricks
  for (const uint64_t voxel : voxels) masks[voxel >> 6] |= uint64_t{1} << (voxel & 63);
  std::set<std::pair<uint64_t, uint64_t>> bricks;
  for (const auto& [code, mask] : masks) bricks.emplace(oracle::brick_hash(mask), mask);
  std::vector<uint64_t> hashes;
  std::map<uint64_t, uint32_t> index;
  for (const auto& [hash, mask] : bricks) {
    index[mask] = static_cast<uint32_t>(hashes.size());
    hashes.push_back(hash);
    dag.bricks.push_back(mask);
  }
  std::map<uint64_t, uint32_t> places;
  for (const auto& [code, mask] : masks) places[code] = index[mask];
  dag.svo_nodes = places.size();
  for (uint32_t level = levels - 2; level-- > 0;) {
    std::map<uint64_t, oracle::Node> nodes;
    std::map<uint64_t, std::vector<uint64_t>> child_hashes;
    for (const auto& [code, child] : places) {
      nodes[code >> 3].mask |= 1u << (code & 7);
      nodes[code >> 3].children.push_back(child);
      child_hashes[code >> 3].push_back(hashes[child]);
    }
    std::map<oracle::Node, uint32_t> numbers;
    for (auto& [code, node] : nodes) {
      node.hash = oracle::node_hash(node.mask, child_hashes[code]);
      numbers[node] = 0;
    }
    dag.levels.emplace_back();
    hashes.clear();
    for (auto& [node, number] : numbers) {
      number = static_cast<uint32_t>(hashes.size());
      hashes.push_back(node.hash);
      dag.levels.back().push_back(node);
    }
    places.clear();
    for (const auto& [code, node] : nodes) places[code] = numbers[node];
    dag.svo_nodes += places.size();
  }
  return dag;
}

// Returns the encoded regions of tier 0 (docs/format.md), in Morton order.
inline std::vector<EncodedRegion> encode_regions(const ColoredScene& scene) {
  const uint32_t levels = std::min(scene.color_levels, kRegionLevels);
  std::map<uint64_t, std::vector<ColoredCell>> cells;
  for (const uint64_t code : scene.cells(scene.color_levels))
    cells[code >> 3 * levels].push_back(
        {static_cast<uint32_t>(code & ((uint64_t{1} << 3 * levels) - 1)), scene.sum_of(code)});
  std::vector<EncodedRegion> regions;
  for (const auto& [morton, of_region] : cells)
    regions.push_back(encode_region(levels, morton, of_region));
  return regions;
}

inline void write_levels(GlobalFileWriter& writer, const oracle::Dag& dag, uint32_t levels) {
  uint32_t level = levels - 2;
  const auto words = level_words(dag, writer.narrow_words());
  for (size_t i = 0; i < words.size(); ++i, --level) {
    writer.begin_level(level);
    writer.checksum_words(words[i]);
    writer.write_words(0, words[i]);
    writer.end_level({i == 0 ? dag.bricks.size() : dag.levels[i - 1].size(), words[i].size()});
  }
}

inline void write_colors(GlobalFileWriter& writer, const ColoredScene& scene) {
  MemoryBudget budget(uint64_t{1} << 28);
  AttributeSectionWriter colors(writer, Attribute::kColor, scene.color_levels, {}, budget);
  for (const EncodedRegion& region : encode_regions(scene)) colors.add_region(region);
  colors.finish();
}

inline GlobalFileSummary write_colored(const std::string& path, const ColoredScene& scene,
                                       bool with_colors = true,
                                       uint64_t narrow_words = global_layout::kNarrowLevelWords) {
  const oracle::Dag dag = sparse_dag(scene.voxels, scene.levels);
  GlobalFileWriter writer(system_files(), path, Grid::given({0, 0, 0}, 1, scene.levels), 64,
                          narrow_words);
  write_levels(writer, dag, scene.levels);
  if (with_colors) write_colors(writer, scene);
  return writer.finish({dag.voxels, dag.svo_nodes});
}

// Reads a little-endian number of `size` bytes at an offset.
inline uint64_t number_at(const ByteString& bytes, uint64_t at, size_t size) {
  uint64_t value = 0;
  for (size_t i = size; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes.at(at + i));
  return value;
}

// Updates the checksums of a damaged file that has only one checksum block.
inline void put_checksums_right(ByteString& file) {
  const uint64_t table = number_at(file, 96, 8);
  const auto data = std::as_bytes(std::span(file));
  const uint64_t block = checksum64(data.subspan(4096, table - 4096));
  std::memcpy(file.data() + table, &block, 8);
  const uint64_t of_table = checksum64(data.subspan(table, 8));
  std::memcpy(file.data() + 112, &of_table, 8);
  const uint64_t header = checksum64(data.first(4088));
  std::memcpy(file.data() + 4088, &header, 8);
}

// Decodes the color section in the bytes of a file, as docs/format.md describes it.
class SectionDecoder {
 public:
  using Color3 = std::array<int, 3>;

  SectionDecoder(const ByteString& bytes, const ColoredScene& scene) : bytes_(bytes) {
    const uint64_t entry = 1152;
    section_ = u(entry + 8, 8);
    const uint64_t section_bytes = u(entry + 16, 8);
    const uint32_t c = scene.color_levels;
    EXPECT_EQ(u(8, 4), 2u);
    EXPECT_EQ(u(120, 8), 1u);
    EXPECT_EQ(u(2176, 8) & 2, 2u);
    EXPECT_EQ(u(entry, 4), 1u);
    EXPECT_EQ(u(entry + 4, 4), c);
    EXPECT_EQ(u(entry + 40, 4), 16u);
    EXPECT_EQ(u(entry + 32, 8), scene.cells(c).size());
    const uint64_t tiers = c / 7 + 1;
    uint64_t end = 0, all_cells = 0;
    for (uint64_t t = 0; t < tiers; ++t) {
      const uint64_t tier = section_ + section_bytes - 32 * (tiers - t);
      const uint32_t finest = c - static_cast<uint32_t>(7 * t);
      EXPECT_EQ(u(tier, 8), end);
      const uint64_t directory = end + 16 * u(tier + 8, 8), regions = u(tier + 16, 8);
      all_cells += decode_tier(scene, finest, section_ + end, section_ + directory, regions);
      EXPECT_EQ(u(tier + 24, 8), all_cells - before_);
      before_ = all_cells;
      end = directory + 32 * regions;
    }
    EXPECT_EQ(section_bytes, end + 32 * tiers);
    EXPECT_EQ(u(entry + 24, 8), all_cells);
  }

  // Returns the colors by level and Morton code.
  const std::map<std::pair<uint32_t, uint64_t>, Color3>& colors() const { return colors_; }

 private:
  uint64_t u(uint64_t at, size_t size) const { return number_at(bytes_, at, size); }
  // Reads `count` bits of the block, from bit `bit` on.
  unsigned bits(uint64_t block, unsigned bit, unsigned count) const {
    unsigned value = 0;
    for (unsigned i = count; i-- > 0;)
      value = value << 1 | (u(block + (bit + i) / 8, 1) >> (bit + i) % 8 & 1);
    return value;
  }
  Color3 decode(uint64_t block, unsigned cell) const {
    const bool mode_b = bits(block, 0, 16) == 0;
    int ends[2][3];
    for (unsigned e = 0; e < 2; ++e)
      for (unsigned channel = 0; channel < 3; ++channel) {
        if (mode_b) {
          ends[e][channel] = static_cast<int>(bits(block, 16 + 24 * e + 16 - 8 * channel, 8));
          continue;
        }
        const unsigned width = channel == 1 ? 6 : 5, low = channel == 0 ? 11 : channel == 1 ? 5 : 0;
        const unsigned v = bits(block, 16 * e + low, width);
        ends[e][channel] = static_cast<int>(width == 6 ? 4 * v + v / 16 : 8 * v + v / 4);
      }
    const int top = mode_b ? 3 : 7;
    const int w =
        static_cast<int>(mode_b ? bits(block, 64 + 2 * cell, 2) : bits(block, 32 + 3 * cell, 3));
    Color3 color;
    for (size_t i = 0; i < 3; ++i)
      color[i] = ((top - w) * ends[0][i] + w * ends[1][i] + top / 2) / top;
    return color;
  }

  uint64_t decode_tier(const ColoredScene& scene, uint32_t finest, uint64_t data,
                       uint64_t directory, uint64_t regions) {
    const uint32_t depth = std::min(finest, 6u);
    std::map<uint64_t, std::vector<Codes>> codes;  // by region and level
    for (uint32_t i = 0; i <= depth; ++i)
      for (const uint64_t code : scene.cells(finest - i)) {
        auto& levels = codes[code >> 3 * (depth - i)];
        levels.resize(depth + 1);
        levels[i].push_back(code);
      }
    EXPECT_EQ(codes.size(), regions);
    uint64_t at = 0, all_cells = 0;
    for (const auto& [region, levels] : codes) {
      const size_t offsets[] = {16, 20, 22, 24, 26, 27, 28}, sizes[] = {4, 2, 2, 2, 1, 1, 1};
      EXPECT_EQ(u(directory, 8), region);
      EXPECT_EQ(u(directory + 8, 8), at);
      uint64_t cell = 0;
      for (uint32_t i = 0; i <= 6; ++i)
        EXPECT_EQ(u(directory + offsets[i], sizes[i]), i <= depth ? levels[i].size() : 0);
      for (uint32_t i = 0; i <= depth; ++i)
        for (const uint64_t code : levels[i]) {
          colors_[{finest - i, code}] = decode(data + 16 * (at + cell / 32), cell % 32);
          ++cell;
        }
      at += (cell + 31) / 32;
      all_cells += cell;
      uint64_t prefixes = 0;
      for (uint32_t i = 0; i + 4 < depth; ++i)
        for (const uint64_t code : levels[i + 4]) {
          const auto first = std::lower_bound(levels[i].begin(), levels[i].end(), code << 12);
          EXPECT_EQ(u(data + 16 * at + 4 * prefixes++, 4),
                    static_cast<uint64_t>(first - levels[i].begin()));
        }
      at += (prefixes + 3) / 4;
      directory += 32;
    }
    EXPECT_EQ(data + 16 * at, directory - 32 * regions);
    return all_cells;
  }

  const ByteString& bytes_;
  uint64_t section_ = 0, before_ = 0;
  std::map<std::pair<uint32_t, uint64_t>, Color3> colors_;
};

}  // namespace voxdag
