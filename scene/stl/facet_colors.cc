#include "scene/stl/facet_colors.h"

#include <span>
#include <string_view>

#include "core/color/surface.h"
#include "scene/stl/stl_format.h"
#include "scene/textures/linear_light.h"

namespace voxdag::stl {

FacetColors::FacetColors(const ReadableFile& file) {
  for (size_t i = 0; i < light_.size(); ++i) light_[i] = linear_light(static_cast<double>(i) / 31);
  default_.fill(kFullIntensity);
  std::array<char, kCountAt> header;
  file.read_at(0, std::as_writable_bytes(std::span(header)));
  constexpr std::string_view kColor = "COLOR=";
  const std::string_view text(header.data(), header.size());
  const size_t at = text.find(kColor);
  if (at == text.npos || at + kColor.size() + 4 > text.size()) return;
  is_materialise_ = true;
  for (size_t c = 0; c < 3; ++c) {
    const auto byte = static_cast<unsigned char>(text[at + kColor.size() + c]);
    default_[c] = linear_light(byte / 255.0);
  }
}

}  // namespace voxdag::stl
