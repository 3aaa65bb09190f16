// The appearance of a triangle of a scene: its base color in the terms of glTF 2.0 (section 3.9),
// converted to integers, so that the color of a voxel is the same on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "core/geometry/fixed_triangle.h"
#include "core/geometry/grid.h"

namespace voxdag {

// Fractional bits of texture coordinates.
inline constexpr int kTextureBits = 24;
// The integer that stands for 1.0 in colors (linear), factors and alpha.
inline constexpr uint16_t kFullIntensity = 65535;

// A corner of a triangle.
struct SurfaceCorner {
  // Texture coordinates from the image's upper left corner, after KHR_texture_transform and before
  // wrapping. The width or height of the image is 2^kTextureBits. Magnitudes are at most 2^40.
  std::array<int64_t, 2> texture{};
  // The vertex color (COLOR_0 in glTF) as red, green, blue (linear) and alpha, with kFullIntensity
  // for 1. White if the file has no vertex colors.
  std::array<uint16_t, 4> color{kFullIntensity, kFullIntensity, kFullIntensity, kFullIntensity};
};

// A triangle in world space with its appearance.
struct SurfaceTriangle {
  WorldTriangle position;
  std::array<SurfaceCorner, 3> corners;
  uint32_t material = 0;  // index into SceneMaterials::materials
  // True if the corners run clockwise when seen from the front: in mirrored instances, and in every
  // second triangle of a strip. Only normals depend on this flag.
  bool is_flipped = false;
};

// A SurfaceTriangle snapped to the lattice of the grid.
struct FixedSurface {
  FixedTriangle position;
  std::array<SurfaceCorner, 3> corners;
  uint32_t material = 0;
  bool is_flipped = false;
};

enum class AlphaMode : uint8_t { kOpaque, kMask, kBlend };
enum class Wrap : uint8_t { kRepeat, kMirroredRepeat, kClampToEdge };

struct Material {
  static constexpr uint32_t kNoImage = UINT32_MAX;
  static constexpr uint32_t kNoNumber = UINT32_MAX;

  std::string name;
  // Index into SceneMaterials::names; kNoNumber if the file gives the triangle no material.
  uint32_t number = kNoNumber;
  // Base color (linear) and alpha. kFullIntensity stands for 1.
  std::array<uint16_t, 4> factor{kFullIntensity, kFullIntensity, kFullIntensity, kFullIntensity};
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  uint16_t alpha_cutoff = kFullIntensity / 2;  // used if alpha_mode is kMask
  uint32_t image = kNoImage;                   // index into SceneMaterials::images
  std::array<Wrap, 2> wrap{Wrap::kRepeat, Wrap::kRepeat};

  bool operator==(const Material&) const = default;
};

}  // namespace voxdag
