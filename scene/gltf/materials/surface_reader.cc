#include "scene/gltf/materials/surface_reader.h"

#include <algorithm>
#include <bit>

#include "scene/gltf/document/check_document.h"
#include "scene/surface_numbers.h"

namespace voxdag::gltf {

SurfaceReader::SurfaceReader(const Document& document, BufferReader& buffers, uint64_t vertices,
                             unsigned readers)
    : document_(document), buffers_(buffers) {
  constexpr uint64_t kBlockBytes = kBlockVertices * sizeof(SurfaceCorner);
  const uint64_t wanted = std::bit_ceil((vertices + kBlockVertices - 1) / kBlockVertices);
  const uint64_t fits_budget = buffers.budget().available() / kShareOfFree / readers / kBlockBytes;
  const uint64_t slots = std::clamp<uint64_t>(std::bit_floor(fits_budget), 1, wanted);
  corners_ =
      PageBuffer<SurfaceCorner>(buffers.budget(), static_cast<size_t>(slots * kBlockVertices),
                                "texture coordinates of a scene");
  block_in_slot_.assign(static_cast<size_t>(slots), kNoBlock);
  slot_mask_ = static_cast<size_t>(slots - 1);
}

void SurfaceReader::bind(const Primitive& primitive) {
  const PrimitiveSurface& surface = primitive.surface;
  std::ranges::fill(block_in_slot_, kNoBlock);
  material_ = surface.material;
  transform_ = document_.materials->transforms[material_];
  open(surface.texture_coordinates, texture_coordinates_);
  open(surface.color, colors_);
  is_plain_ = !texture_coordinates_ && !colors_;
  vertices_ = document_.accessors[static_cast<size_t>(primitive.position)].count;
  if (!colors_) return;
  const Accessor& color = document_.accessors[static_cast<size_t>(surface.color)];
  color_components_ = static_cast<size_t>(color.components);
  const bool is_scaled = color.normalized || color.component_type == kFloat;
  color_scale_ = is_scaled ? 1 : color.component_type == kUnsignedByte ? 255 : 65535;
}

void SurfaceReader::open(int accessor, std::optional<AccessorReader>& out) {
  out.reset();
  if (accessor < 0) return;
  const Accessor& a = document_.accessors[static_cast<size_t>(accessor)];
  for (int buffer : buffers_of(document_, a)) buffers_.check_length(buffer);
  out.emplace(document_, buffers_, accessor);
}

void SurfaceReader::load(uint64_t block, size_t slot) {
  block_in_slot_[slot] = kNoBlock;
  const uint64_t first = block * kBlockVertices;
  const auto count = static_cast<size_t>(std::min(kBlockVertices, vertices_ - first));
  SurfaceCorner* const out = &corners_[slot * kBlockVertices];
  std::fill_n(out, count, SurfaceCorner{});
  if (texture_coordinates_) load_texture_coordinates(first, count, out);
  if (colors_) load_colors(first, count, out);
  block_in_slot_[slot] = block;
}

void SurfaceReader::load_texture_coordinates(uint64_t first, size_t count, SurfaceCorner* out) {
  numbers_.resize(2 * count);
  texture_coordinates_->read(first, count, numbers_.data());
  for (size_t i = 0; i < count; ++i) {
    double u = numbers_[2 * i], v = numbers_[2 * i + 1];
    transform_.apply(u, v);
    out[i].texture = {texture_lattice(u), texture_lattice(v)};
  }
}

void SurfaceReader::load_colors(uint64_t first, size_t count, SurfaceCorner* out) {
  numbers_.resize(color_components_ * count);
  colors_->read(first, count, numbers_.data());
  for (size_t i = 0; i < count; ++i)
    for (size_t c = 0; c < color_components_; ++c)
      out[i].color[c] = intensity_of(numbers_[color_components_ * i + c] / color_scale_);
}

}  // namespace voxdag::gltf
