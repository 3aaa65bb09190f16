// The share of light that a surface reflects, from the colors of a file. Without colors, surfaces
// are gray plaster. The file must outlive the Albedo object. Not thread-safe.
#pragma once

#include <optional>

#include "core/format/global/voxdag_reader.h"
#include "query/dag/vec.h"
#include "query/render/surface_hit.h"

namespace voxdag::query {

// Albedo of a surface without a color, linear.
inline constexpr Vec kPlaster{{0.74, 0.70, 0.64}};

class Albedo {
 public:
  // `colors`: the file whose colors are shown. If it is null or has no colors, the result is gray.
  explicit Albedo(const voxdag_reader::File* colors) {
    if (colors && colors->has_colors()) cursor_.emplace(*colors);
  }
  // Returns the reflected share of red, green and blue light, linear. Throws Error{kCorrupt} for
  // damaged colors.
  Vec of(const SurfaceHit& surface);

 private:
  std::optional<voxdag_reader::ColorCursor> cursor_;
};

}  // namespace voxdag::query
