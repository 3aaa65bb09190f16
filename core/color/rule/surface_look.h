// The color of a triangle at one of its points, computed from texture, factor, vertex color and
// alpha.
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/host_device.h"
#include "core/base/integers.h"
#include "core/color/color_sum.h"
#include "core/color/cutouts/hidden.h"
#include "core/color/rule/exact.h"
#include "core/color/rule/texture_lookup.h"
#include "core/color/samples/sample_batch.h"
#include "core/color/surface.h"

namespace voxdag::color {

// A point of a triangle, given by its barycentric coordinates (weights) times 2^kPointBits.
// `second` is the weight of vertex 1, `third` of vertex 2. The weights of all three vertices add up
// to 2^kPointBits.
inline constexpr int kPointBits = 30;
inline constexpr int64_t kPointOne = int64_t{1} << kPointBits;
struct SurfacePoint {
  int64_t second, third;
};

// Returns the point with these weights, changed where necessary so that none of the three weights
// is negative.
VOXDAG_HD inline SurfacePoint surface_point(double second, double third) {
  constexpr double kOne = static_cast<double>(kPointOne);
  SurfacePoint point{0, 0};
  if (second > 0) point.second = second < kOne ? static_cast<int64_t>(second) : kPointOne;
  if (third > 0) point.third = third < kOne ? static_cast<int64_t>(third) : kPointOne;
  if (point.third > kPointOne - point.second) point.third = kPointOne - point.second;
  return point;
}

// Returns the level of the image's pyramid that has one to two texels along the edge of a color
// cell, on average over the triangle. Let t be the number of texels of level 0 in the triangle, and
// c the triangle's area in square color cells. The result is the largest existing level l with 4^l
// <= t / c.
//
// `area` is twice the triangle's area in square lattice units (1/256 voxel). If it is 0, t is the
// square of the longest edge in texels, and c is the square of the longest edge in color cells,
// where the length of an edge is at least one lattice unit. All values are IEEE doubles, computed
// in the order of the code below.
template <class Textures>
VOXDAG_HD inline uint32_t pyramid_level(const FixedSurface& surface, Textures& textures,
                                        uint32_t image, int cell_bits, double area) {
  const auto& c = surface.corners;
  double du[3], dv[3];  // changes of the texture coordinates along the edges
  const double width = textures.width(image, 0), height = textures.height(image, 0);
  for (size_t i = 0; i < 3; ++i) {
    const size_t j = (i + 1) % 3;
    du[i] = static_cast<double>(c[j].texture[0] - c[i].texture[0]);
    dv[i] = static_cast<double>(c[j].texture[1] - c[i].texture[1]);
  }
  double texels;  // twice the texels in the triangle, times 2^(2 kTextureBits)
  if (area > 0) {
    const double determinant = du[0] * dv[1] - du[1] * dv[0];
    texels = (determinant < 0 ? -determinant : determinant) * (width * height);
  } else {
    texels = 0;
    area = 1;
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      double length = 0;
      for (int a = 0; a < 3; ++a) {
        const double d = static_cast<double>(surface.position.v[j][a] - surface.position.v[i][a]);
        length += d * d;
      }
      const double across = du[i] * width, down = dv[i] * height;
      const double texel_length = across * across + down * down;
      if (length > area) area = length;
      if (texel_length > texels) texels = texel_length;
    }
  }
  const double cell = static_cast<double>(int64_t{1} << cell_bits);
  const double available = texels * (cell * cell);
  double needed = area * 0x1p50;  // least `available` for level 1: 4 * area * 2^(2 kTextureBits)
  const uint32_t levels = textures.levels(image);
  uint32_t level = 0;
  for (; level + 1 < levels && needed <= available; ++level) needed *= 4;
  return level;
}

VOXDAG_HD inline Texel tinted(Texel texel, const uint32_t (&tint)[4]) {
  Texel out = 0;
  for (int c = 0; c < 4; ++c) out |= Texel{scaled(channel(texel, c), tint[c])} << 16 * c;
  return out;
}

// Returns the alpha, 0 to 255, of a surface whose texture and tint give `alpha`, which is 0 to
// 65535. `is_cut` is explained at SurfaceLook. If it is set, the alpha of the mode kMask is always
// 255, because the mask of the cutouts has already excluded hidden texels.
VOXDAG_HD inline uint32_t surface_alpha(const Material& material, uint32_t alpha, bool is_cut) {
  return is_cut && material.alpha_mode == AlphaMode::kMask ? 255 : alpha_by_mode(material, alpha);
}

// Returns the color of all points of a surface, if they have the same: the surface has no image,
// and its corners have equal colors. `is_cut` is explained at SurfaceLook.
VOXDAG_HD inline std::optional<FlatColor> flat_color_of(const FixedSurface& surface,
                                                        const Material& material,
                                                        bool is_cut = false) {
  const auto& corners = surface.corners;
  if (material.image != Material::kNoImage || corners[0].color != corners[1].color ||
      corners[0].color != corners[2].color)
    return std::nullopt;
  const auto channel_of = [&](size_t c) { return scaled(material.factor[c], corners[0].color[c]); };
  FlatColor color;
  for (size_t c = 0; c < 3; ++c) color.rgb[c] = static_cast<uint16_t>(channel_of(c));
  color.alpha = static_cast<uint8_t>(surface_alpha(material, channel_of(3), is_cut));
  return color;
}

// Computes the color of a triangle at its points. The surface, the material and the textures must
// outlive this object.
template <class Textures>
class SurfaceLook {
 public:
  // `is_cut` is true if the material has a mask (Cutouts). The colors in the material's image are
  // then already multiplied by alpha.
  VOXDAG_HD SurfaceLook(const FixedSurface& surface, const Material& material, Textures& textures,
                        int cell_bits, double area, bool is_cut = false)
      : corners_(surface.corners.data()),
        material_(material),
        textures_(textures),
        is_cut_(is_cut) {
    for (size_t a = 0; a < 2; ++a) {
      wrap_[a] = material.wrap[a];
      for (size_t i = 0; i < 2; ++i)
        change_[i][a] = corners_[i + 1].texture[a] - corners_[0].texture[a];
    }
    is_near_ = true;
    for (const auto& change : change_)
      for (const int64_t c : change) is_near_ = is_near_ && c < kNear && c > -kNear;
    if (material.image != Material::kNoImage) {
      level_ = pyramid_level(surface, textures, material.image, cell_bits, area);
      view_.emplace(textures.view(material.image, level_));
    }
    one_tint_ = corners_[0].color == corners_[1].color && corners_[0].color == corners_[2].color;
    if (one_tint_) set_tint({0, 0});
    no_tint_ = one_tint_;
    for (const uint32_t t : tint_) no_tint_ = no_tint_ && t == kFullIntensity;
  }

  // Sets the members of `out` that describe the color. Returns false if SampleKernels cannot
  // compute this color.
  bool describe(SampledSurface& out) const {
    if constexpr (requires { view_->tiled(); }) {
      const bool is_opaque = material_.alpha_mode == AlphaMode::kOpaque ||
                             (is_cut_ && material_.alpha_mode == AlphaMode::kMask);
      if (!view_ || !one_tint_ || !is_opaque) return false;
      out.level = view_->tiled();
      if (!out.level.texels) return false;
      for (int a = 0; a < 2; ++a) {
        out.wrap[a] = wrap_[a];
        out.texture[a] = corners_[0].texture[static_cast<size_t>(a)];
        for (int i = 0; i < 2; ++i) {
          constexpr int64_t kSmall = int64_t{1} << 30;
          if (change_[i][a] >= kSmall || change_[i][a] <= -kSmall) return false;
          out.change[a][i] = static_cast<int32_t>(change_[i][a]);
        }
      }
      out.has_tint = !no_tint_;
      for (size_t c = 0; c < 4; ++c) out.tint[c] = tint_[c];
      return true;
    }
    return false;
  }
  // True if texels whose alpha is not full need texel_at().
  bool is_cut() const { return is_cut_; }

  // A point of the triangle, and the texels around the point.
  struct Spot {
    SurfacePoint point;
    TexelSquare texels;  // unused if the material has no image
  };
  // Returns the spot of a point, and prefetches its texels.
  VOXDAG_HD Spot spot_at(const SurfacePoint& point) const {
    Spot spot{point, {}};
    if (!view_) return spot;
    spot.texels = texels_around(*view_, wrap_, coordinate(point, 0), coordinate(point, 1));
    view_->prefetch(spot.texels.x.first, spot.texels.y.first);
    view_->prefetch(spot.texels.x.first, spot.texels.y.second);
    return spot;
  }

  // Returns the color at a spot. Its fourth channel is not the alpha, but alpha() computes it.
  VOXDAG_HD Texel texel_at(const Spot& spot) {
    Texel texel = ~Texel{0};
    if (view_) texel = is_cut_ ? visible_texel(spot) : look_up(*view_, spot.texels);
    if (no_tint_) return texel;
    if (!one_tint_) set_tint(spot.point);
    return tinted(texel, tint_);
  }
  // Returns the alpha, 0 to 255, at a spot with this texel_at().
  VOXDAG_HD uint32_t alpha(Texel texel) const {
    return surface_alpha(material_, channel(texel, 3), is_cut_);
  }

 private:
  // Returns the mean color of the visible texels around a spot, and the mean alpha of all texels
  // around it. Uses the finest level that has visible texels there.
  VOXDAG_HD Texel visible_texel(const Spot& spot) {
    Texel texel = look_up(*view_, spot.texels);
    for (uint32_t level = level_ + 1;
         channel(texel, 3) == 0 && level < textures_.levels(material_.image); ++level) {
      auto view = textures_.view(material_.image, level);
      texel = look_up(
          view, texels_around(view, wrap_, coordinate(spot.point, 0), coordinate(spot.point, 1)));
    }
    const uint32_t alpha = channel(texel, 3);
    if (alpha == 0) return 0;
    Texel out = Texel{alpha} << 48;
    for (int c = 0; c < 3; ++c) {
      const uint32_t intensity = (channel(texel, c) * uint32_t{kFullIntensity} + alpha / 2) / alpha;
      out |= Texel{intensity < kFullIntensity ? intensity : kFullIntensity} << 16 * c;
    }
    return out;
  }

  // Sets tint_ to the material's factor times the vertex color at a point.
  VOXDAG_HD void set_tint(const SurfacePoint& point) {
    const int64_t first = kPointOne - point.second - point.third;
    for (size_t c = 0; c < 4; ++c) {
      const int64_t mean = (first * corners_[0].color[c] + point.second * corners_[1].color[c] +
                            point.third * corners_[2].color[c] + kPointOne / 2) >>
                           kPointBits;
      tint_[c] = scaled(material_.factor[c], static_cast<uint32_t>(mean));
    }
  }

  // Returns texture coordinate `a` of a point, rounded down. If a coordinate changes by 2^32 (256
  // images) or more over the triangle, products need 128 bits.
  VOXDAG_HD int64_t coordinate(const SurfacePoint& point, int a) const {
    const int64_t second = change_[0][a], third = change_[1][a];
    int64_t change;
    if (is_near_)
      change = (second * point.second + third * point.third) >> kPointBits;
    else
      change = static_cast<int64_t>(
          (static_cast<int128>(second) * point.second + static_cast<int128>(third) * point.third) >>
          kPointBits);
    return corners_[0].texture[static_cast<size_t>(a)] + change;
  }

  static constexpr int64_t kNear = int64_t{1} << 32;

  const SurfaceCorner* corners_;
  const Material& material_;
  Textures& textures_;
  const bool is_cut_;
  uint32_t level_ = 0;                           // level of view_
  std::optional<typename Textures::View> view_;  // nullopt if the material has no image
  Wrap wrap_[2];
  int64_t change_[2][2];  // changes of texture coordinates from corner 0 to corners 1 and 2
  bool is_near_;          // all changes are below kNear
  bool one_tint_;         // the same tint for the complete triangle
  bool no_tint_;          // the tint does not change texels
  uint32_t tint_[4] = {};
};

}  // namespace voxdag::color
