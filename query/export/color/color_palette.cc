#include "query/export/color/color_palette.h"

#include <algorithm>
#include <cmath>

#include "query/export/color/linear_colors.h"

namespace voxdag::query {
namespace {

using voxdag_reader::Rgb;
using Lab = std::array<uint32_t, 3>;

// An Oklab coordinate x is stored as the integer (x + kLabShift) * kLabScale. The shift is
// necessary because Oklab's coordinates a and b can be negative. With this scale, the integers of
// two neighboring gray levels of 8 bits differ by about 16, and sums of squares over 2^32 voxels
// fit in 64 bits.
constexpr double kLabScale = 4096, kLabShift = 1;

// Returns the cube root, by Newton's method with a start value above the root. The number of steps
// is fixed. It is enough for oklab_of(), where the roots for 8-bit colors are 0 or at least 1/40.
double cube_root(double x) {
  double root = 1;
  for (int i = 0; i < 24; ++i) root = (2 * root + x / (root * root)) / 3;
  return root;
}

Lab oklab_of(Rgb color) {
  const auto light = [](uint8_t channel) { return linear_of_srgb()[channel] / 65535.0; };
  const double r = light(color.r), g = light(color.g), b = light(color.b);
  const double l = cube_root(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const double m = cube_root(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const double s = cube_root(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  const auto fixed = [](double x) {
    return static_cast<uint32_t>(std::floor((x + kLabShift) * kLabScale + 0.5));
  };
  return {fixed(0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s),
          fixed(1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s),
          fixed(0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s)};
}

uint32_t bin_of(Rgb color) {
  return static_cast<uint32_t>(color.r >> 2 << 12 | color.g >> 2 << 6 | color.b >> 2);
}

uint32_t packed(Rgb color) { return static_cast<uint32_t>(color.r << 16 | color.g << 8 | color.b); }

}  // namespace

ColorPalette::ColorPalette(MemoryBudget& budget)
    : charge_(budget, kBins * (sizeof(Bin) + sizeof(Point) + 1), "the palette"), bins_(kBins) {}

void ColorPalette::add(Rgb color) {
  is_exact_ = is_exact_ && add_distinct(packed(color));
  Bin& bin = bins_[bin_of(color)];
  ++bin.count;
  bin.sums[0] += color.r;
  bin.sums[1] += color.g;
  bin.sums[2] += color.b;
}

bool ColorPalette::add_distinct(uint32_t packed) {
  const auto place = std::ranges::lower_bound(distinct_, packed);
  if (place != distinct_.end() && *place == packed) return true;
  if (distinct_.size() == kMaxColors) return false;
  distinct_.insert(place, packed);
  return true;
}

void ColorPalette::make() {
  colors_.clear();
  if (is_exact_) {
    for (const uint32_t p : distinct_)
      colors_.push_back(
          {static_cast<uint8_t>(p >> 16), static_cast<uint8_t>(p >> 8), static_cast<uint8_t>(p)});
    return;
  }
  points_.clear();
  points_.reserve(kBins);
  for (uint32_t bin = 0; bin < kBins; ++bin)
    if (bins_[bin].count != 0) points_.push_back({oklab_of(mean_of(bins_[bin])), bin});
  std::vector<PaletteBox> boxes = {box_of(0, points_.size())};
  while (boxes.size() < kMaxColors) {
    // Cuts the first of the boxes with the largest spread. If the spread is 0, no box can be cut.
    const auto largest = std::ranges::max_element(boxes, {}, &PaletteBox::spread);
    if (largest->spread == 0) break;
    const PaletteBox box = *largest;
    const size_t middle = cut(box);
    *largest = box_of(box.begin, middle);
    boxes.push_back(box_of(middle, box.end));
  }
  for (const PaletteBox& box : boxes) colors_.push_back(mean_of(sum_of(box)));
  assign_bins();
}

ColorPalette::PaletteBox ColorPalette::box_of(size_t begin, size_t end) const {
  PaletteBox box{begin, end};
  for (size_t axis = 0; axis < 3; ++axis) {
    uint64_t sum = 0, count = 0, spread = 0;
    for (size_t i = begin; i < end; ++i) {
      sum += bins_[points_[i].bin].count * points_[i].lab[axis];
      count += bins_[points_[i].bin].count;
    }
    for (size_t i = begin; i < end; ++i) {
      const int64_t distance = int64_t{points_[i].lab[axis]} - static_cast<int64_t>(sum / count);
      spread += bins_[points_[i].bin].count * static_cast<uint64_t>(distance * distance);
    }
    if (spread > box.spread) box = {begin, end, axis, spread, sum, count};
  }
  return box;
}

// Cuts a box, whose spread must not be 0, at its mean: moves the points below the mean to the
// front, and returns the index of the first point of the second part. The order of the points
// within the two parts does not matter, because only sums over them are computed.
size_t ColorPalette::cut(const PaletteBox& box) {
  const auto first = points_.begin() + static_cast<ptrdiff_t>(box.begin);
  const auto last = points_.begin() + static_cast<ptrdiff_t>(box.end);
  const auto middle = std::partition(
      first, last, [&](const Point& point) { return point.lab[box.axis] * box.count < box.sum; });
  return static_cast<size_t>(middle - points_.begin());
}

ColorPalette::Bin ColorPalette::sum_of(const PaletteBox& box) const {
  Bin sum;
  for (size_t i = box.begin; i < box.end; ++i) {
    const Bin& bin = bins_[points_[i].bin];
    sum.count += bin.count;
    for (size_t c = 0; c < 3; ++c) sum.sums[c] += bin.sums[c];
  }
  return sum;
}

Rgb ColorPalette::mean_of(const Bin& bin) {
  const auto channel = [&](size_t c) {
    return static_cast<uint8_t>((bin.sums[c] + bin.count / 2) / bin.count);
  };
  return {channel(0), channel(1), channel(2)};
}

// Gives each bin the palette color that is nearest to the bin. This color can be the mean of a box
// that does not contain the bin. If several colors are equally near, the first one is used.
void ColorPalette::assign_bins() {
  std::vector<Lab> labs;
  for (const Rgb color : colors_) labs.push_back(oklab_of(color));
  index_of_bin_.assign(kBins, 0);
  for (const Point& point : points_) {
    int64_t nearest = INT64_MAX;
    for (size_t i = 0; i < labs.size(); ++i) {
      int64_t distance = 0;
      for (size_t axis = 0; axis < 3; ++axis) {
        const int64_t along = int64_t{point.lab[axis]} - int64_t{labs[i][axis]};
        distance += along * along;
      }
      if (distance >= nearest) continue;
      nearest = distance;
      index_of_bin_[point.bin] = static_cast<uint8_t>(i);
    }
  }
}

uint8_t ColorPalette::index_of(Rgb color) const {
  if (!is_exact_) return index_of_bin_[bin_of(color)];
  return static_cast<uint8_t>(std::ranges::lower_bound(distinct_, packed(color)) -
                              distinct_.begin());
}

}  // namespace voxdag::query
