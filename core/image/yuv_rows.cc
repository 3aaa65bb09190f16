#include "core/image/yuv_rows.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/image/image_reader.h"

namespace voxdag {
namespace {

// Weights of red and blue in luma, for each value of MatrixCoefficients (H.273, table 4). Files
// without a value, and files that derive the weights from primaries, use BT.601.
struct Weights {
  int matrix;
  double red, blue;
};
constexpr Weights kWeights[] = {
    {1, 0.2126, 0.0722}, {2, 0.299, 0.114}, {4, 0.30, 0.11},     {5, 0.299, 0.114},
    {6, 0.299, 0.114},   {7, 0.212, 0.087}, {9, 0.2627, 0.0593}, {12, 0.299, 0.114},
};

// The position of an image row or column among the rows or columns of chroma samples, which have
// half the resolution. The position is between the samples `near` and `far`, a quarter of the way
// from `near` to `far`.
struct HalfPosition {
  size_t near, far;
};
HalfPosition half_position(size_t at, size_t count) {
  const size_t near = at / 2;
  if (at % 2 == 1) return {near, std::min(near + 1, count - 1)};
  return {near, near > 0 ? near - 1 : 0};
}

}  // namespace

YuvRows::YuvRows(const YuvPlanes& planes) : planes_(planes) {
  constexpr int kIdentityMatrix = 0, kYcgcoMatrix = 8;
  max_ = static_cast<double>((1 << planes.bits) - 1);
  const auto step = static_cast<double>(1 << (planes.bits - 8));
  luma_low_ = planes.is_limited ? 16 * step : 0;
  luma_range_ = planes.is_limited ? 219 * step : max_;
  chroma_range_ = planes.is_limited ? 224 * step : max_;
  if (planes.matrix == kIdentityMatrix) {
    kind_ = Kind::kIdentity;
  } else if (planes.matrix == kYcgcoMatrix) {
    kind_ = Kind::kYcgco;
  } else {
    const auto found = std::ranges::find(kWeights, planes.matrix, &Weights::matrix);
    if (found == std::end(kWeights))
      throw BrokenImage{"has colors with the matrix " + std::to_string(planes.matrix) +
                        " of ITU-T H.273, expected 0 to 2, 4 to 9 or 12"};
    red_ = found->red;
    blue_ = found->blue;
  }
  for (auto& chroma : chroma_) chroma.resize(planes.width);
}

double YuvRows::sample(const Plane& plane, size_t x, size_t y) const {
  const uint8_t* const row = plane.bytes + y * plane.row_bytes;
  if (planes_.bits == 8) return row[x];
  uint16_t value;
  std::memcpy(&value, row + 2 * x, sizeof value);
  return value;
}

void YuvRows::read_chroma(const Plane& plane, uint32_t y, std::vector<double>& out) const {
  if (!plane.bytes) return;
  const size_t width = (size_t{planes_.width} + planes_.halves_width) >> planes_.halves_width;
  const size_t height = (size_t{planes_.height} + planes_.halves_height) >> planes_.halves_height;
  const HalfPosition v = planes_.halves_height ? half_position(y, height) : HalfPosition{y, y};
  const double middle = kind_ == Kind::kIdentity ? 0 : static_cast<double>(1 << (planes_.bits - 1));
  const auto column = [&](size_t x) {
    return 0.75 * sample(plane, x, v.near) + 0.25 * sample(plane, x, v.far);
  };
  for (size_t x = 0; x < out.size(); ++x) {
    const HalfPosition u = planes_.halves_width ? half_position(x, width) : HalfPosition{x, x};
    out[x] = (0.75 * column(u.near) + 0.25 * column(u.far) - middle) / chroma_range_;
  }
}

std::array<double, 3> YuvRows::rgb_at(size_t x, uint32_t y) const {
  const double luma = (sample(planes_.color[0], x, y) - luma_low_) / luma_range_;
  if (!planes_.color[1].bytes) return {luma, luma, luma};
  const double u = chroma_[0][x], v = chroma_[1][x];
  if (kind_ == Kind::kIdentity) {
    const double low = luma_low_ / chroma_range_, scale = chroma_range_ / luma_range_;
    return {(v - low) * scale, luma, (u - low) * scale};
  }
  if (kind_ == Kind::kYcgco) return {(luma - u) + v, luma + u, (luma - u) - v};
  const double red = luma + 2 * (1 - red_) * v, blue = luma + 2 * (1 - blue_) * u;
  return {red, ((luma - red_ * red) - blue_ * blue) / ((1 - red_) - blue_), blue};
}

void YuvRows::read(uint32_t y, std::span<std::byte> out) {
  for (size_t i = 0; i < 2; ++i) read_chroma(planes_.color[i + 1], y, chroma_[i]);
  const double full = planes_.bits == 8 ? 255 : 65535;
  const auto put = [&](size_t i, double value) {
    const auto rounded = static_cast<uint16_t>(std::clamp(value, 0.0, 1.0) * full + 0.5);
    if (planes_.bits == 8)
      out[i] = static_cast<std::byte>(rounded);
    else
      std::memcpy(&out[2 * i], &rounded, sizeof rounded);
  };
  for (size_t x = 0; x < planes_.width; ++x) {
    const std::array<double, 3> rgb = rgb_at(x, y);
    const double alpha = planes_.alpha.bytes ? sample(planes_.alpha, x, y) / max_ : 1;
    const double divisor = planes_.is_premultiplied && alpha > 0 ? alpha : 1;
    for (size_t c = 0; c < 3; ++c) put(4 * x + c, rgb[c] / divisor);
    put(4 * x + 3, alpha);
  }
}

}  // namespace voxdag
