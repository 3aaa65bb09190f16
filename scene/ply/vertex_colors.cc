#include "scene/ply/vertex_colors.h"

#include <algorithm>
#include <bit>

#include "scene/surface_numbers.h"
#include "scene/textures/linear_light.h"

namespace voxdag::ply {
namespace {

double full_intensity_of(Type type) {
  if (!is_integer(type)) return 1;
  return type == Type::kUint16 ? 65535 : 255;
}

}  // namespace

VertexColors::VertexColors(const PlyFile& ply, unsigned readers, MemoryBudget& budget)
    : reader_(ply, ply.colors(), budget), numbers_(ply.colors().size() * kBlockVertices) {
  for (const size_t property : ply.colors())
    full_.push_back(full_intensity_of(ply.vertex_element().properties[property].type));
  for (size_t i = 0; i < light_of_byte_.size(); ++i)
    light_of_byte_[i] = linear_light(static_cast<double>(i) / 255);
  constexpr uint64_t kBlockBytes = kBlockVertices * sizeof(Color);
  const uint64_t wanted = std::bit_ceil((reader_.count() + kBlockVertices - 1) / kBlockVertices);
  const uint64_t fits_budget = budget.available() / kShareOfFree / readers / kBlockBytes;
  const uint64_t slots = std::clamp<uint64_t>(std::bit_floor(fits_budget), 1, wanted);
  colors_ = PageBuffer<Color>(budget, static_cast<size_t>(slots * kBlockVertices),
                              "the colors of vertices");
  block_in_slot_.assign(static_cast<size_t>(slots), kNoBlock);
  slot_mask_ = static_cast<size_t>(slots) - 1;
}

void VertexColors::load(uint64_t block, size_t slot) {
  block_in_slot_[slot] = kNoBlock;
  const uint64_t first = block * kBlockVertices;
  const auto count = static_cast<size_t>(std::min(kBlockVertices, reader_.count() - first));
  reader_.read(first, count, numbers_.data());
  const size_t channels = full_.size();
  for (size_t i = 0; i < count; ++i) {
    Color color{kFullIntensity, kFullIntensity, kFullIntensity, kFullIntensity};
    for (size_t c = 0; c < channels; ++c) {
      const double number = numbers_[channels * i + c];
      const double value = number > 0 ? std::min(number, full_[c]) : 0;  // 0 for NaN
      color[c] = c == 3            ? intensity_of(value / full_[c])
                 : full_[c] == 255 ? light_of_byte_[static_cast<size_t>(value)]
                                   : linear_light(value / full_[c]);
    }
    colors_[slot * kBlockVertices + i] = color;
  }
  block_in_slot_[slot] = block;
}

}  // namespace voxdag::ply
