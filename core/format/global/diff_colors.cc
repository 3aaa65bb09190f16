#include "core/format/global/diff_colors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <vector>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/parallel_for.h"
#include "core/format/global/open_global.h"
#include "core/geometry/morton.h"

namespace voxdag {
namespace {

using voxdag_reader::ColorCursor;
using voxdag_reader::ColorRegion;
using voxdag_reader::ColorSection;
using voxdag_reader::ColorTier;
using voxdag_reader::File;

// The cubes of this level, at most 2^18, are divided among the threads.
constexpr uint32_t kSharedLevel = 6;

// A cube that is set in both files: its Morton code, and its place (open_global.h) in each file.
struct CommonCube {
  uint64_t code = 0;
  std::array<uint64_t, 2> places{};
};

class ColorComparison {
 public:
  ColorComparison(const File& a, const File& b)
      : a_(a), b_(b), levels_(std::min(a.color_levels(), b.color_levels())) {}

  ColorDiff run(unsigned threads, const CancelToken& cancel) const {
    const uint32_t shared = std::min(kSharedLevel, levels_);
    std::vector<CommonCube> cubes;
    walk(0, {}, shared, [&](const CommonCube& cube) { cubes.push_back(cube); });
    std::vector<ColorDiff> of_thread(std::max(1u, threads));
    parallel_for(threads, cubes.size(), [&](unsigned thread, size_t i) {
      cancel.check();
      ColorDiff& diff = of_thread[thread];
      ColorCursor a(a_), b(b_);
      walk(shared, cubes[i], levels_,
           [&](const CommonCube& cell) { diff.add(color(a, cell), color(b, cell)); });
    });
    ColorDiff total{levels_};
    for (const ColorDiff& diff : of_thread) {
      total.cells += diff.cells;
      total.different_cells += diff.different_cells;
      total.largest = std::max(total.largest, diff.largest);
      total.sum += diff.sum;
      total.squares += diff.squares;
    }
    return total;
  }

 private:
  // Calls visit(cube) for the common cubes of level `target` within a cube, in Morton order.
  template <class Visit>
  void walk(uint32_t level, const CommonCube& cube, uint32_t target, const Visit& visit) const {
    if (level == target) return visit(cube);
    const auto [a, b] = cube.places;
    const uint32_t common = child_mask_at(a_, level, a) & child_mask_at(b_, level, b);
    for (int i = 0; i < 8; ++i)
      if (common >> i & 1)
        walk(level + 1,
             {cube.code << 3 | static_cast<uint64_t>(i),
              {child_place_at(a_, level, a, i), child_place_at(b_, level, b, i)}},
             target, visit);
  }
  voxdag_reader::Rgb color(ColorCursor& cursor, const CommonCube& cell) const {
    uint32_t x, y, z;
    morton_decode(cell.code, x, y, z);
    return cursor.color(x, y, z, levels_).value();
  }

  const File &a_, &b_;
  const uint32_t levels_;
};

bool same_words(const File& a, const File& b) {
  for (uint32_t l = 0; l <= a.brick_level(); ++l) {
    const voxdag_reader::Level &of_a = a.level(l), &of_b = b.level(l);
    if (of_a.word_count != of_b.word_count || of_a.pointer_bits != of_b.pointer_bits ||
        !std::equal(of_a.words, of_a.words + of_a.word_count, of_b.words))
      return false;
  }
  return true;
}

bool same_sections(const File& a, const File& b) {
  if (a.color_levels() != b.color_levels()) return false;
  for (uint32_t t = 0; t < a.colors().tier_count(); ++t) {
    const ColorTier &of_a = a.colors().tier(t), &of_b = b.colors().tier(t);
    if (of_a.units != of_b.units || of_a.region_count != of_b.region_count ||
        std::memcmp(of_a.data, of_b.data, 16 * of_a.units) != 0 ||
        std::memcmp(of_a.directory, of_b.directory, 32 * of_a.region_count) != 0)
      return false;
  }
  return true;
}

uint64_t finest_cells(const File& file) {
  const ColorTier& tier = file.colors().tier(0);
  uint64_t cells = 0;
  for (uint64_t i = 0; i < tier.region_count; ++i) {
    ColorRegion region;
    if (!ColorSection::region(tier, i, region))
      file.broken_section(
          file.colors(),
          "region " + std::to_string(i) +
              " of the finest tier is damaged: expected counts and an offset within the "
              "section");
    cells += region.counts[0];
  }
  return cells;
}

}  // namespace

void ColorDiff::add(const voxdag_reader::Rgb& a, const voxdag_reader::Rgb& b) {
  ++cells;
  if (a == b) return;
  ++different_cells;
  for (const int difference : {a.r - b.r, a.g - b.g, a.b - b.b}) {
    const auto size = static_cast<uint32_t>(std::abs(difference));
    largest = std::max(largest, size);
    sum += size;
    squares += size * size;
  }
}

double ColorDiff::mean() const {
  return cells == 0 ? 0 : static_cast<double>(sum) / (3 * static_cast<double>(cells));
}

double ColorDiff::psnr() const {
  if (squares == 0) return std::numeric_limits<double>::infinity();
  return 10 *
         std::log10(255.0 * 255.0 * 3 * static_cast<double>(cells) / static_cast<double>(squares));
}

ColorDiff diff_colors(const File& a, const File& b, unsigned threads, const CancelToken& cancel) {
  for (const File* file : {&a, &b})
    if (!file->has_colors())
      throw Error(ErrorCode::kInvalidInput,
                  file->path() + " has no colors: expected files that were built with " +
                      option_text("color"));
  if (a.grid_levels() != b.grid_levels())
    throw Error(ErrorCode::kInvalidInput,
                "only colors of the same grid can be compared: " + a.path() + " has 2^" +
                    std::to_string(a.grid_levels()) + " voxels per edge, " + b.path() + " has 2^" +
                    std::to_string(b.grid_levels()));
  return with_reader_errors([&] {
    if (same_words(a, b) && same_sections(a, b))
      return ColorDiff{.levels = a.color_levels(), .cells = finest_cells(a)};
    return ColorComparison(a, b).run(threads, cancel);
  });
}

}  // namespace voxdag
