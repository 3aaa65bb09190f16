// Reads texels of the pyramids of a TextureSet, for one thread. A pyramid is an image and its
// coarser levels. The texels come from memory if the pyramids fit, and otherwise from pages of the
// scratch file. A reader caches as many pages as its memory can hold. Not thread-safe; any number
// of readers may be open.
//
// A level is stored as tiles (core/color/samples/tiled_level.h). Each tile is one page.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/host_device.h"
#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/color/samples/tiled_level.h"
#include "core/io/file_system.h"

namespace voxdag {

inline constexpr size_t kPageTexels = size_t{kTileEdge} * kTileEdge;
inline constexpr size_t kPageBytes = kPageTexels * sizeof(uint64_t);

// Returns the checksum of a page, which detects damage in the scratch file.
uint32_t page_checksum(std::span<const uint64_t> texels);

// A level of a pyramid.
struct TextureLevel {
  uint32_t width = 0, height = 0;
  uint32_t tiles_per_row = 0;
  uint64_t first_page = 0;  // number of its first page in the scratch file, or in memory

  uint64_t pages() const {
    return uint64_t{tiles_per_row} * ((height + kTileEdge - 1) >> kTileShift);
  }
};

// The levels of all images. The levels of image i begin at first_level[i].
struct TextureLayout {
  std::vector<TextureLevel> levels;
  std::vector<uint32_t> first_level;  // one entry per image, then levels.size()
};

class TextureReader {
 public:
  // Makes a reader of pyramids in memory. `layout` and `pages` must outlive the reader.
  TextureReader(const TextureLayout& layout, const uint64_t* pages)
      : layout_(layout), all_(pages) {}
  // Makes a reader of pyramids in a file. Caches at least two pages, in about `memory_bytes`.
  // `checksums` has one value per page. `layout`, `file`, `checksums` and `budget` must outlive the
  // reader.
  TextureReader(const TextureLayout& layout, const ReadableFile& file, const uint32_t* checksums,
                uint64_t memory_bytes, MemoryBudget& budget);

  // Returns the number of levels of an image. The number is 0 for an image that no material uses or
  // that is unreadable. The first level has the size of the image. Each further level has half the
  // width and height, rounded down but at least 1. The last level has one texel.
  uint32_t levels(uint32_t image) const {
    return layout_.first_level[image + 1] - layout_.first_level[image];
  }
  uint32_t width(uint32_t image, uint32_t level) const { return at(image, level).width; }
  uint32_t height(uint32_t image, uint32_t level) const { return at(image, level).height; }

  // One level, for many lookups. The reader must outlive it.
  class View {
   public:
    uint32_t width() const { return width_; }
    uint32_t height() const { return height_; }
    // Returns four linear channels of 16 bits: red in the lowest, then green, blue and alpha.
    // 0 <= x < width, 0 <= y < height, counted from the upper left. Throws Error{kIo}, and
    // Error{kCorrupt} for a page that fails its checksum.
    uint64_t texel(uint32_t x, uint32_t y) const {
      const uint64_t place = place_of(x, y);
      return texels_ ? texels_[place] : reader_.cached_texel(first_ + place);
    }
    // Returns the level's texels in memory; without texels if they are in the file.
    TiledLevel tiled() const {
      return {texels_, width_, height_, static_cast<uint32_t>(row_of_tiles_)};
    }
    // Starts to load a texel that is in memory into the CPU's cache, for a later texel().
    VOXDAG_PREFETCH void prefetch(uint32_t x, uint32_t y) const {
      if (texels_) __builtin_prefetch(&texels_[place_of(x, y)]);
    }

   private:
    friend class TextureReader;
    View(TextureReader& reader, const TextureLevel& level)
        : reader_(reader),
          first_(level.first_page * kPageTexels),
          texels_(reader.all_ ? reader.all_ + first_ : nullptr),
          row_of_tiles_(level.tiles_per_row * uint64_t{kPageTexels}),
          width_(level.width),
          height_(level.height) {}

    uint64_t place_of(uint32_t x, uint32_t y) const {
      // The texel's offset along y and its offset along x. Each is the offset of the tile plus the
      // offset of the texel in the tile.
      const uint64_t row = (y >> kTileShift) * row_of_tiles_ + ((y % kTileEdge) << kTileShift);
      const uint64_t column = (uint64_t{x >> kTileShift} << 2 * kTileShift) + x % kTileEdge;
      return row + column;
    }

    TextureReader& reader_;
    uint64_t first_;          // first texel of the level in the file
    const uint64_t* texels_;  // texels of the level; null if they are in the file
    uint64_t row_of_tiles_;   // texels in a row of tiles
    uint32_t width_, height_;
  };
  View view(uint32_t image, uint32_t level) { return View(*this, at(image, level)); }

  uint64_t texel(uint32_t image, uint32_t level, uint32_t x, uint32_t y) {
    return view(image, level).texel(x, y);
  }

 private:
  static constexpr uint64_t kNoPage = ~uint64_t{0};
  // Spreads pages over the slots. The numbers of vertically adjacent tiles often differ by a power
  // of two, and without this factor they would share a slot.
  static constexpr uint64_t kSpread = 0x9e3779b97f4a7c15ull;

  const TextureLevel& at(uint32_t image, uint32_t level) const {
    return layout_.levels[layout_.first_level[image] + level];
  }
  uint64_t cached_texel(uint64_t number) {
    const uint64_t page = number / kPageTexels;
    const size_t slot = static_cast<size_t>((page * kSpread) >> slot_shift_);
    if (page_in_slot_[slot] != page) load(page, slot);
    return cache_[slot * kPageTexels + number % kPageTexels];
  }
  void load(uint64_t page, size_t slot);

  const TextureLayout& layout_;
  const uint64_t* const all_ = nullptr;  // all texels; null if they are in the file
  const ReadableFile* file_ = nullptr;
  const uint32_t* checksums_ = nullptr;
  int slot_shift_ = 63;
  std::vector<uint64_t> page_in_slot_;
  MemoryCharge slots_charge_;
  PageBuffer<uint64_t> cache_;
};

}  // namespace voxdag
