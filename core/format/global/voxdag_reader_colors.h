// The part of voxdag_reader.h that reads colors and the other attributes of cells (alpha, normals,
// materials). Copy all three voxdag_reader headers into your engine, and include voxdag_reader.h.
// docs/format.md, "The color section" and "The sections of alpha, normals and materials", describes
// the bytes.
//
// A section has a color, or another value, for all set cells of the levels from 0 to the section's
// finest level. The levels are divided into tiers of up to seven levels, and a tier into regions of
// up to 64^3 cells of the tier's finest level. A region first has the values of its cells of that
// level in Morton order, then of the next coarser level, and so on. The position of a cell's value
// follows from the cell's rank: the number of set cells of the same level that come before the cell
// in the region. The DAG determines this rank.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "voxdag_reader_bytes.h"

namespace voxdag_reader {

// Returns the number at `at`, which need not be aligned.
template <class T>
T get(const unsigned char* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return value;
}

// A color in sRGB, with 8 bits per channel, ready for display.
struct Rgb {
  unsigned char r = 0, g = 0, b = 0;
  friend bool operator==(const Rgb& x, const Rgb& y) {
    return x.r == y.r && x.g == y.g && x.b == y.b;
  }
  friend bool operator!=(const Rgb& x, const Rgb& y) { return !(x == y); }
};

// A unit vector in world space.
struct Normal {
  float x = 0, y = 0, z = 0;
};

// Returns the normal that two bytes encode by octahedral projection. Any bytes are a valid normal.
inline Normal octahedral_normal(const unsigned char* bytes) {
  const double across = bytes[0] - 127.0, along = bytes[1] - 127.0;
  const double width = across < 0 ? -across : across, height = along < 0 ? -along : along;
  double x = across, y = along;
  const double z = 127 - width - height;
  if (z < 0) {
    x = across < 0 ? height - 127 : 127 - height;
    y = along < 0 ? width - 127 : 127 - width;
  }
  const double scale = 1 / std::sqrt(x * x + y * y + z * z);
  return {static_cast<float>(x * scale), static_cast<float>(y * scale),
          static_cast<float>(z * scale)};
}

// Returns the color of cell `i`, 0 to 31, in a color block of 16 bytes. Any bytes are valid colors.
inline Rgb block_color(const unsigned char* block, unsigned i) {
  const auto u16 = [&](unsigned at) {
    return static_cast<unsigned>(block[at] | block[at + 1] << 8);
  };
  const auto mix = [](unsigned a, unsigned b, unsigned weight, unsigned top) {
    return static_cast<unsigned char>((a * (top - weight) + b * weight + top / 2) / top);
  };
  if (u16(0) == 0) {  // mode B: two end colors of 24 bits, weights of 2 bits
    const unsigned w = static_cast<unsigned>(block[8 + i / 4] >> 2 * (i % 4)) & 3;
    return {mix(block[4], block[7], w, 3), mix(block[3], block[6], w, 3),
            mix(block[2], block[5], w, 3)};
  }
  const unsigned bit = 32 + 3 * i, at = std::min(bit / 8, 14u), w = u16(at) >> (bit - 8 * at) & 7;
  const auto channel = [&](int shift, int bits) {
    const auto widen = [&](unsigned end) {
      const unsigned value = end >> shift & ((1u << bits) - 1);
      return value << (8 - bits) | value >> (2 * bits - 8);
    };
    return mix(widen(u16(0)), widen(u16(2)), w, 7);
  };
  return {channel(11, 5), channel(5, 6), channel(0, 5)};
}

inline int count_set_bits(uint64_t x) {
  x -= x >> 1 & 0x5555555555555555u;
  x = (x & 0x3333333333333333u) + (x >> 2 & 0x3333333333333333u);
  return static_cast<int>(((x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fu) * 0x0101010101010101u >> 56);
}

// Returns the Morton code of a cell: the bits of x, y and z interleaved, x highest. The cells of a
// level are ordered by this code. Uses 21 bits of each coordinate.
inline uint64_t morton_code(int64_t x, int64_t y, int64_t z) {
  const auto spread = [](int64_t coordinate) {
    uint64_t v = static_cast<uint64_t>(coordinate) & 0x1fffff;
    v = (v | v << 32) & 0x001f00000000ffffu;
    v = (v | v << 16) & 0x001f0000ff0000ffu;
    v = (v | v << 8) & 0x100f00f00f00f00fu;
    v = (v | v << 4) & 0x10c30c30c30c30c3u;
    return (v | v << 2) & 0x1249249249249249u;
  };
  return spread(x) << 2 | spread(y) << 1 | spread(z);
}

// A tier: the levels finest_level, finest_level - 1, ... region_level. The regions of the tier are
// cells of region_level. The pointers point into memory of the File.
struct ColorTier {
  const unsigned char* data = nullptr;  // data of the regions
  uint64_t units = 0;                   // size of `data` in units of 16 bytes
  const unsigned char* directory = nullptr;
  uint64_t region_count = 0;
  uint64_t cell_count = 0;  // set cells of all levels of the tier
  uint32_t finest_level = 0, region_level = 0;
  uint32_t block_bytes = 16;  // bytes for the values of 32 cells
};

// Returns the name of a region for messages.
inline std::string region_text(const ColorTier& tier, uint64_t morton) {
  return "the region of level " + std::to_string(tier.region_level) + " with Morton code " +
         std::to_string(morton);
}

// The colors, or other values, of a region. The memory of the values belongs to the File.
struct ColorRegion {
  uint64_t morton = 0;      // Morton code of the region among the cubes of the tier's region level
  uint64_t first_unit = 0;  // where its data begin in ColorTier::data, in units of 16 bytes
  uint32_t level_count = 0;
  uint32_t counts[7] = {};  // cells of each level, the finest level first
  uint64_t cells = 0;       // cells of all levels
  const unsigned char* blocks = nullptr;
  uint32_t block_bytes = 16;

  // Returns the value of cell `i` of the region: alpha, a material or the code of a normal. Cells
  // are numbered from 0 in the order in which they are stored. Not for colors.
  uint32_t value(uint64_t i) const {
    const uint32_t bytes = block_bytes / 32;
    uint32_t value = 0;
    for (uint32_t b = bytes; b-- > 0;) value = value << 8 | blocks[i * bytes + b];
    return value;
  }
  Normal normal(uint64_t i) const { return octahedral_normal(blocks + 2 * i); }
  // Returns the color of cell `i` of the region's cells. `i` must be below `cells`.
  Rgb color(uint64_t i) const { return block_color(blocks + i / 32 * 16, unsigned(i % 32)); }
  // Two tables of prefixes save counting when the rank of a cell is computed (see the top of this
  // file). Table 0 is for the cells of the finest level, table 1 for those of the next coarser
  // level. A table has one entry for each set cell four levels above, in Morton order: the rank of
  // the first cell below that cell. This rank is the number of cells of the table's level that come
  // before it in the region. prefix_count() returns the number of entries of a table.
  uint64_t prefix_count(uint32_t table) const {
    return table + 5 < level_count ? counts[table + 4] : 0;
  }
  uint32_t prefix(uint32_t table, uint64_t entry) const {
    if (table == 1) entry += prefix_count(0);
    uint32_t value;
    std::memcpy(&value, blocks + block_bytes * ((cells + 31) / 32) + 4 * entry, sizeof value);
    return value;
  }
  // Returns the size of the region's data (blocks and prefixes) in units of 16 bytes.
  uint64_t units() const {
    return (cells + 31) / 32 * (block_bytes / 16) + (prefix_count(0) + prefix_count(1) + 3) / 4;
  }
};

// The kinds of attribute sections, and the bytes that 32 values take in a section of each kind. 0
// bytes means that the values are indices in a list of names. The length of the list then
// determines the width of the values.
enum Kind : uint32_t { kColors = 1, kAlphas, kNormals, kMaterials, kEndOfKinds };
constexpr uint32_t kKindBlockBytes[kEndOfKinds] = {0, 16, 32, 64, 0};

// The section of one attribute: the colors of a file, or other values of its cells.
class ColorSection {
 public:
  // Opens a section of a known kind. `section` is its first byte, and `bytes` its size. Returns an
  // error message, or null if there is no error.
  const char* open(const unsigned char* section, uint64_t bytes, uint32_t color_levels,
                   uint32_t kind = kColors, uint32_t block_bytes = 16) {
    const bool has_names = kKindBlockBytes[kind] == 0;
    const bool is_width = has_names ? block_bytes == 32 || block_bytes == 64 || block_bytes == 128
                                    : block_bytes == kKindBlockBytes[kind];
    if (!is_width) return "its blocks do not have the size that the kind of attribute requires";
    kind_ = kind;
    color_levels_ = color_levels;
    tier_count_ = color_levels / 7 + 1;
    if (bytes < 32 * tier_count_) return "is too short for its tier table";
    const uint64_t tables = bytes - 32 * tier_count_;
    uint64_t end = 0;
    for (uint32_t t = 0; t < tier_count_; ++t) {
      const unsigned char* const entry = section + tables + 32 * t;
      ColorTier& tier = tiers_[t];
      tier.units = get<uint64_t>(entry + 8);
      tier.region_count = get<uint64_t>(entry + 16);
      tier.cell_count = get<uint64_t>(entry + 24);
      tier.finest_level = color_levels - 7 * t;
      tier.region_level = tier.finest_level - std::min<uint32_t>(tier.finest_level, 6);
      if (get<uint64_t>(entry) != end)
        return "a tier does not begin at the end of the tier before it";
      if (tier.units > (tables - end) / 16) return "the data of a tier end beyond the section";
      tier.block_bytes = block_bytes;
      tier.data = section + end;
      end += 16 * tier.units;
      if (tier.region_count == 0 || tier.region_count > (tables - end) / 32)
        return "a directory has no regions, or ends beyond the section";
      tier.directory = section + end;
      end += 32 * tier.region_count;
    }
    if (has_names) return read_names(section + end, tables - end, block_bytes / 32);
    return end == tables ? nullptr : "is longer than its tiers";
  }
  // Returns the names of the materials. The value of a cell is an index in this list. The last name
  // is "", for triangles without a material.
  const std::vector<std::string>& names() const { return names_; }

  // Returns the plural of the attribute's name, for messages.
  const char* name() const {
    constexpr const char* kNames[kEndOfKinds] = {"", "colors", "alphas", "normals", "materials"};
    return kNames[kind_];
  }
  uint32_t color_levels() const { return color_levels_; }
  uint32_t tier_count() const { return tier_count_; }
  const ColorTier& tier(uint32_t t) const { return tiers_[t]; }
  // Returns the tier that has level `l`. The level is 0 to color_levels().
  const ColorTier& tier_of(uint32_t l) const { return tiers_[(color_levels_ - l) / 7]; }

  // Sets `region` to the i-th region of a tier, and checks that its bytes are inside the tier.
  // Returns false if the directory entry is damaged.
  static bool region(const ColorTier& tier, uint64_t i, ColorRegion& region) {
    const unsigned char* const entry = tier.directory + 32 * i;
    region.morton = get<uint64_t>(entry);
    region.first_unit = get<uint64_t>(entry + 8);
    region.block_bytes = tier.block_bytes;
    region.level_count = tier.finest_level - tier.region_level + 1;
    region.cells = 0;
    for (uint32_t j = 0; j < 7; ++j) {
      const uint32_t count = j == 0  ? get<uint32_t>(entry + 16)
                             : j < 4 ? get<uint16_t>(entry + 18 + 2 * j)
                                     : entry[22 + j];
      const uint32_t most = j < region.level_count ? 1u << 3 * (region.level_count - 1 - j) : 0;
      if (count > most || (count == 0) != (most == 0)) return false;
      region.counts[j] = count;
      region.cells += count;
    }
    const uint64_t units = region.units();
    if (units > tier.units || region.first_unit > tier.units - units) return false;
    region.blocks = tier.data + 16 * region.first_unit;
    return true;
  }
  // Returns the index of the first region whose Morton code is not below `morton`; region_count if
  // all are below it.
  static uint64_t lower_bound(const ColorTier& tier, uint64_t morton) {
    uint64_t low = 0, high = tier.region_count;
    while (low < high) {
      const uint64_t middle = low + (high - low) / 2;
      if (get<uint64_t>(tier.directory + 32 * middle) < morton)
        low = middle + 1;
      else
        high = middle;
    }
    return low;
  }

 private:
  const char* read_names(const unsigned char* at, uint64_t bytes, uint32_t value_bytes) {
    const char* const kBroken =
        "the list of materials does not fit between the last tier and the tier table";
    const uint64_t count = bytes < 4 ? 0 : get<uint32_t>(at);
    if (count == 0 || 4 * count > bytes - 4) return kBroken;
    if (count > kMaxMaterials || bytes > kMaxNamesBytes)
      return "the list of materials is too long, expected at most 2^20 materials and 64 MiB";
    if (value_bytes != (count <= 256 ? 1u : count <= 65536 ? 2u : 4u))
      return "the values of materials have the wrong width for their number";
    uint64_t end = 4;
    names_.reserve(static_cast<size_t>(count));
    for (uint64_t i = 0; i < count; ++i) {
      if (bytes - end < 4 || get<uint32_t>(at + end) > bytes - end - 4) return kBroken;
      const uint32_t size = get<uint32_t>(at + end);
      names_.emplace_back(reinterpret_cast<const char*>(at + end + 4), size);
      end += uint64_t{4} + size;
    }
    return bytes - end < 16 ? nullptr : kBroken;
  }

  // Limits of the list of materials, which is read when the file is opened.
  static constexpr uint64_t kMaxMaterials = uint64_t{1} << 20, kMaxNamesBytes = uint64_t{64} << 20;

  uint32_t kind_ = kColors, color_levels_ = 0, tier_count_ = 0;
  ColorTier tiers_[3];
  std::vector<std::string> names_;
};

// Looks up colors, or another attribute. A lookup is fast if the cell is near the cell of the
// previous lookup. The File must outlive the cursor. Each thread needs a separate cursor.
template <class Dag>
class BasicColorCursor {
 public:
  explicit BasicColorCursor(const Dag& dag) : BasicColorCursor(dag, dag.colors()) {}
  // Creates a cursor for another section, such as dag.normals().
  BasicColorCursor(const Dag& dag, const ColorSection& section) : dag_(&dag), section_(&section) {
    path_[0] = 0;
  }

  // See File::color().
  std::optional<Rgb> color(int64_t x, int64_t y, int64_t z, uint32_t level) {
    uint64_t i = 0;
    const ColorRegion* const region = find(x, y, z, level, i);
    return region ? std::optional(region->color(i)) : std::nullopt;
  }
  // See File::alpha(), material() and normal(). The cursor must be for their section.
  std::optional<uint32_t> value(int64_t x, int64_t y, int64_t z, uint32_t level) {
    uint64_t i = 0;
    const ColorRegion* const region = find(x, y, z, level, i);
    return region ? std::optional(region->value(i)) : std::nullopt;
  }
  std::optional<Normal> normal(int64_t x, int64_t y, int64_t z, uint32_t level) {
    uint64_t i = 0;
    const ColorRegion* const region = find(x, y, z, level, i);
    return region ? std::optional(region->normal(i)) : std::nullopt;
  }
  // Finds the value of a cell: returns the region that has it, and sets `i` to the index of the
  // value in the region. The region is valid until the next call. Returns null if the cell is not
  // set or has no value.
  const ColorRegion* find(int64_t x, int64_t y, int64_t z, uint32_t level, uint64_t& i) {
    if (section_->tier_count() == 0 || level > dag_->grid_levels()) return nullptr;
    const int64_t edge = int64_t{1} << level;
    if (x < 0 || y < 0 || z < 0 || x >= edge || y >= edge || z >= edge) return nullptr;
    const uint64_t code = morton_code(x, y, z);
    if (!descend(level, code)) return nullptr;
    const uint32_t stored = std::min(level, section_->color_levels());
    i = stored_index(stored, code >> 3 * (level - stored));
    return &region_;
  }

 private:
  // The *place* of a cell in the DAG is the word offset of its node or brick. Below the bricks it
  // is the mask of the cell's children.
  uint32_t brick_level() const { return dag_->brick_level(); }
  uint32_t mask(uint32_t level, uint64_t place) const {
    if (level < brick_level()) return dag_->node(level, place).child_mask;
    if (level > brick_level()) return static_cast<uint32_t>(place);
    uint64_t any = dag_->brick(place);
    // Sets the lowest bit of each byte that is not 0.
    any |= any >> 4;
    any |= any >> 2;
    any |= any >> 1;
    return static_cast<uint32_t>((any & 0x0101010101010101u) * 0x0102040810204080u >> 56);
  }
  // Returns the place of child `index`, which must exist.
  uint64_t child(uint32_t level, uint64_t place, unsigned index) const {
    if (level < brick_level()) return Dag::child(dag_->node(level, place), static_cast<int>(index));
    return level == brick_level() ? dag_->brick(place) >> 8 * index & 255 : 0;
  }
  // Returns the number of set cells of level `target` in the first `children` octants (0 to 8) of
  // the cube at `place`.
  uint64_t count(uint32_t level, uint64_t place, uint32_t target, unsigned children = 8) const {
    if (level == target) return 1;
    const uint32_t there = mask(level, place) & ((1u << children) - 1);
    if (level + 1 == target) return static_cast<uint64_t>(count_set_bits(there));
    if (level == brick_level() && children == 8)
      return static_cast<uint64_t>(count_set_bits(dag_->brick(place)));
    uint64_t cells = 0;
    for (unsigned i = 0; i < children; ++i)
      if (there >> i & 1) cells += count(level + 1, child(level, place, i), target);
    return cells;
  }
  // Returns the child index (0 to 7) of the cell that follows path_[level] on the path.
  unsigned step(uint32_t level) const {
    return static_cast<unsigned>(path_code_ >> 3 * (depth_ - level - 1) & 7);
  }
  // Returns the number of set cells of level `target` in the cube path_[from] that come before
  // path_[to].
  uint64_t count_before(uint32_t from, uint32_t to, uint32_t target) const {
    uint64_t cells = 0;
    for (uint32_t level = from; level < to; ++level)
      cells += count(level, path_[level], target, step(level));
    return cells;
  }

  // Changes path_ so that it ends at a cell. If the cell is not set, returns false, and path_ ends
  // at the cell's finest set ancestor.
  bool descend(uint32_t level, uint64_t code) {
    if (dag_->empty()) return false;
    uint32_t shared = std::min(level, depth_);
    uint64_t differing = code >> 3 * (level - shared) ^ path_code_ >> 3 * (depth_ - shared);
    for (; differing != 0; differing >>= 3) --shared;
    depth_ = shared;
    path_code_ = code >> 3 * (level - shared);
    while (depth_ < level) {
      const unsigned index = static_cast<unsigned>(code >> 3 * (level - depth_ - 1) & 7);
      if (!(mask(depth_, path_[depth_]) >> index & 1)) return false;
      path_[depth_ + 1] = child(depth_, path_[depth_], index);
      path_code_ = path_code_ << 3 | index;
      ++depth_;
    }
    return true;
  }

  // Makes region_ the region of a cell on the path, and returns the index of the cell's value in
  // the region. To do this fast, the cursor remembers a *group*: the cells of one level in a cube
  // that is `above` levels coarser (at most three). For each parent of the group's cells, masks_
  // has the mask of the parent's children, and starts_ has the number of cells of the group's level
  // that come before these children in the region.
  uint64_t stored_index(uint32_t level, uint64_t code) {
    const ColorTier& tier = section_->tier_of(level);
    // Number of levels from the cell up to the group's cube.
    const uint32_t above = std::min<uint32_t>(3, level - tier.region_level);
    if (group_level_ != level || group_code_ != code >> 3 * above) {
      group_level_ = kNone;
      enter_region(tier, code >> 3 * (level - tier.region_level));
      enter_group(tier, level, above);
      group_level_ = level;
      group_code_ = code >> 3 * above;
    }
    uint64_t rank = starts_[0];
    if (above > 0) {
      const unsigned parent = static_cast<unsigned>(code >> 3 & ((1u << 3 * (above - 1)) - 1));
      rank = starts_[parent] +
             static_cast<unsigned>(count_set_bits(masks_[parent] & ((1u << (code & 7)) - 1)));
    }
    if (rank >= region_.counts[tier.finest_level - level])
      broken_region(tier, region_.morton, "has fewer values than cells");
    uint64_t before = 0;
    for (uint32_t finer = level + 1; finer <= tier.finest_level; ++finer)
      before += region_.counts[tier.finest_level - finer];
    return before + rank;
  }
  [[noreturn]] void broken_region(const ColorTier& tier, uint64_t morton, const char* what) const {
    dag_->broken_section(*section_, region_text(tier, morton) + " " + what);
  }
  void enter_region(const ColorTier& tier, uint64_t morton) {
    if (region_tier_ == &tier && region_.morton == morton) return;
    region_tier_ = nullptr;
    const uint64_t i = ColorSection::lower_bound(tier, morton);
    if (i == tier.region_count || !ColorSection::region(tier, i, region_) ||
        region_.morton != morton)
      broken_region(tier, morton, "is missing or damaged");
    region_tier_ = &tier;
  }
  // Enters the group whose cube is `above` levels above the cell on the path: sets starts_ and
  // masks_.
  void enter_group(const ColorTier& tier, uint32_t level, uint32_t above) {
    const uint32_t table = tier.finest_level - level, group = level - above;
    uint32_t from = tier.region_level;
    uint64_t rank = 0;
    if (table < 2 && level > tier.region_level + 4) {
      from = level - 4;
      const uint64_t entry = count_before(tier.region_level, from, from);
      if (entry >= region_.prefix_count(table))
        broken_region(tier, region_.morton, "has too few prefixes");
      rank = region_.prefix(table, entry);
    }
    rank += count_before(from, group, level);
    if (above == 0)
      starts_[0] = rank;
    else
      fill_group(group, path_[group], level, 0, rank);
  }
  void fill_group(uint32_t l, uint64_t place, uint32_t level, unsigned code, uint64_t& rank) {
    const uint32_t there = mask(l, place);
    if (l + 1 == level) {
      masks_[code] = there;
      starts_[code] = rank;
      rank += static_cast<uint64_t>(count_set_bits(there));
      return;
    }
    for (unsigned i = 0; i < 8; ++i)
      if (there >> i & 1) fill_group(l + 1, child(l, place, i), level, 8 * code + i, rank);
  }

  static constexpr uint32_t kNone = ~uint32_t{0};
  const Dag* dag_;
  const ColorSection* section_;
  uint64_t path_[21] = {};  // places from the root to the cell looked up last
  uint64_t path_code_ = 0;  // code of that cell
  uint32_t depth_ = 0;      // level of that cell
  const ColorTier* region_tier_ = nullptr;
  ColorRegion region_;
  // The current group; see stored_index().
  uint32_t group_level_ = kNone;  // level of the group's cells
  uint64_t group_code_ = 0;       // Morton code of the group's cube
  uint64_t starts_[64] = {};      // by parent: number of the level's cells before its first child
  uint32_t masks_[64] = {};       // by parent: mask of its children
};

}  // namespace voxdag_reader
