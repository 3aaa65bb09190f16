// The albedo of surfaces: the share of light that a surface reflects. It is the color that the file
// stores, or a gray like plaster if the file has no colors. For figures, it can also show a
// property of the DAG (Shade):
//
//   sharing   how often the node or brick at the surface occurs in the octree, on a logarithmic
//             scale: from dark violet (once) over green to yellow (as often as the most frequent
//             brick)
//   level     the level of the visible cell: a color for each level
//   normal    the surface's normal: red, green and blue are (x + 1) / 2, (y + 1) / 2, (z + 1) / 2
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/format/global/voxdag_reader.h"
#include "query/dag/dag_view.h"
#include "query/dag/vec.h"
#include "query/render/surface_hit.h"

namespace voxdag::query {

// Albedo of a surface without a color, linear.
inline constexpr Vec kPlaster{{0.74, 0.70, 0.64}};

// Returns the colors of a file as albedo. The file must outlive the object. Not thread-safe.
class Albedo {
 public:
  // `colors`: the file whose colors are shown. If it is null or has no colors, all surfaces are
  // gray.
  explicit Albedo(const voxdag_reader::File* colors) {
    if (colors && colors->has_colors()) cursor_.emplace(*colors);
  }
  // Returns the reflected share of red, green and blue light, linear. Throws Error{kCorrupt} for
  // damaged colors.
  Vec of(const SurfaceHit& surface);

 private:
  std::optional<voxdag_reader::ColorCursor> cursor_;
};

enum class Shade { kColor, kSharing, kLevel, kNormal };
// Returns "color", "sharing", "level" and "normal".
const std::vector<std::string>& shade_names();
// Throws Error{kInvalidInput} for an unknown name.
Shade shade_named(const std::string& name);

// Colors that show a property of the DAG. Immutable after construction; thread-safe.
class ShadeColors {
 public:
  // For kSharing, takes 8 bytes of memory for each two words of the DAG. Throws Error{kCorrupt} for
  // a damaged DAG.
  ShadeColors(const DagView& dag, Shade shade);
  // Returns the albedo of a surface, linear. `shade` must not be kColor.
  Vec of(const SurfaceHit& surface) const;

 private:
  void count_places();
  uint64_t places_at(const SurfaceHit& surface) const;

  const DagView& dag_;
  const Shade shade_;
  // For each level, how often each node or brick occurs in the octree. The count of the node at
  // word offset `offset` is element offset / 2 of the level's vector.
  std::vector<std::vector<uint64_t>> places_;
  double log_max_places_ = 0;  // logarithm of the largest count of a brick
};

// Returns the bytes that ShadeColors allocates.
uint64_t shade_bytes(const DagView& dag, Shade shade);
// Returns the linear intensity, from 0 to 1, of an sRGB value from 0 to 1.
double linear_of_srgb_value(double srgb);
// Returns the color of a normal (Shade::kNormal), linear.
Vec normal_color(const Vec& normal);

}  // namespace voxdag::query
