#include "scene/textures/pyramid.h"

#include <algorithm>
#include <array>
#include <utility>

namespace voxdag {
namespace {

struct Taps {
  uint32_t first, count;
  std::array<uint64_t, 3> weights;
};

// Returns the texels from which texel `i` of a level is computed along one axis, and their weights.
// These texels are in the next finer level, which has `fine` texels along this axis.
Taps taps_of(uint32_t i, uint32_t fine) {
  if (fine == 1) return {0, 1, {1, 0, 0}};
  if (fine % 2 == 0) return {2 * i, 2, {1, 1, 0}};
  const uint32_t n = fine / 2;
  return {2 * i, 3, {n - i, n, i + 1}};
}
uint64_t weight_of(uint32_t fine) { return fine == 1 ? 1 : fine % 2 == 0 ? 2 : fine; }

}  // namespace

std::vector<TextureLevel> pyramid_levels(uint32_t width, uint32_t height, uint64_t first_page) {
  std::vector<TextureLevel> levels;
  for (;;) {
    TextureLevel level{width, height, (width + kTileEdge - 1) >> kTileShift, first_page};
    first_page += level.pages();
    levels.push_back(level);
    if (width == 1 && height == 1) return levels;
    width = std::max(width / 2, 1u);
    height = std::max(height / 2, 1u);
  }
}

PyramidBuilder::PyramidBuilder(std::span<const TextureLevel> levels, MemoryBudget& budget,
                               WritePages write)
    : levels_(levels), reduced_(budget, levels[0].width, "a texture"), write_(std::move(write)) {
  for (const TextureLevel& level : levels) {
    Stage stage;
    stage.tiles = PageBuffer<uint64_t>(budget, level.tiles_per_row * kPageTexels, "a texture");
    stage.rows = PageBuffer<uint64_t>(budget, size_t{3} * level.width, "a texture");
    stages_.push_back(std::move(stage));
  }
}

void PyramidBuilder::add_row(size_t index, std::span<const uint64_t> row) {
  const TextureLevel& level = levels_[index];
  Stage& stage = stages_[index];
  const uint32_t y = stage.added++;
  const size_t in_tile = size_t{y % kTileEdge} << kTileShift;
  for (uint32_t x = 0; x < level.width; x += kTileEdge)
    std::copy_n(&row[x], std::min(kTileEdge, level.width - x),
                &stage.tiles[(x >> kTileShift) * kPageTexels + in_tile]);
  if (stage.added % kTileEdge == 0 || stage.added == level.height)
    write_(level.first_page + uint64_t{y >> kTileShift} * level.tiles_per_row,
           {stage.tiles.data(), stage.tiles.size()});
  if (index + 1 == levels_.size()) return;
  std::ranges::copy(row, &stage.rows[size_t{y % 3} * level.width]);
  const uint32_t next = stages_[index + 1].added;
  if (next == levels_[index + 1].height) return;
  const Taps taps = taps_of(next, level.height);
  if (taps.first + taps.count == stage.added) reduce(index, next);
}

// Computes row `y` of level `index` + 1, which is coarser, from the rows of level `index`.
void PyramidBuilder::reduce(size_t index, uint32_t y) {
  const TextureLevel& fine = levels_[index];
  const Stage& stage = stages_[index];
  const uint32_t width = levels_[index + 1].width;
  const Taps rows = taps_of(y, fine.height);
  const uint64_t whole = weight_of(fine.width) * weight_of(fine.height);
  for (uint32_t x = 0; x < width; ++x) {
    const Taps columns = taps_of(x, fine.width);
    std::array<uint64_t, 4> sums{};
    for (uint32_t j = 0; j < rows.count; ++j) {
      const uint64_t* const from =
          &stage.rows[size_t{(rows.first + j) % 3} * fine.width + columns.first];
      for (uint32_t i = 0; i < columns.count; ++i) {
        const uint64_t weight = rows.weights[j] * columns.weights[i];
        for (int c = 0; c < 4; ++c)
          sums[static_cast<size_t>(c)] += weight * (from[i] >> 16 * c & 0xffff);
      }
    }
    uint64_t texel = 0;
    for (int c = 0; c < 4; ++c)
      texel |= (sums[static_cast<size_t>(c)] + whole / 2) / whole << 16 * c;
    reduced_[x] = texel;
  }
  add_row(index + 1, {reduced_.data(), width});
}

}  // namespace voxdag
