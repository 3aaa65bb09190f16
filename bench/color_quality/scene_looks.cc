#include "bench/color_quality/scene_looks.h"

#include <cstdio>
#include <cstring>

#include "core/image/image_reader.h"
#include "scene/textures/image_bytes.h"

namespace voxdag {
namespace {

std::unique_ptr<oracle::ColorImage> decode(const ImageSource& source, MemoryBudget& budget) {
  ImageBytes bytes(system_files(), source);
  const auto reader = open_image(bytes, budget);
  const size_t wide = reader->bits() == 16 ? 2 : 1, full = wide == 2 ? 65535 : 255;
  std::vector<float> linear(full + 1);
  for (size_t i = 0; i <= full; ++i)
    linear[i] = static_cast<float>(
        oracle::srgb_to_linear(static_cast<double>(i) / static_cast<double>(full)));
  auto image = std::make_unique<oracle::ColorImage>();
  image->width = static_cast<int>(reader->width());
  image->height = static_cast<int>(reader->height());
  image->texels.reserve(size_t{reader->width()} * reader->height());
  std::vector<std::byte> row(4 * wide * reader->width());
  for (uint32_t y = 0; y < reader->height(); ++y) {
    reader->read_row(row);
    for (size_t x = 0; x < reader->width(); ++x) {
      std::array<float, 4> texel;
      for (size_t c = 0; c < 4; ++c) {
        uint16_t value = 0;
        std::memcpy(&value, &row[wide * (4 * x + c)], wide);
        texel[c] = c < 3 ? linear[value] : static_cast<float>(value) / static_cast<float>(full);
      }
      image->texels.push_back(texel);
    }
  }
  return image;
}

oracle::Border border_of(Wrap wrap) {
  return wrap == Wrap::kRepeat           ? oracle::Border::kRepeat
         : wrap == Wrap::kMirroredRepeat ? oracle::Border::kMirror
                                         : oracle::Border::kClamp;
}

double one_from(uint16_t value) { return value / 65535.0; }

}  // namespace

SceneLooks::SceneLooks(const SceneMaterials& materials, MemoryBudget& budget) {
  for (const ImageSource& source : materials.images) {
    std::string problem = source.problem;
    images_.emplace_back();
    try {
      if (problem.empty()) images_.back() = decode(source, budget);
    } catch (const BrokenImage& broken) {
      problem = broken.message;
    }
    if (!problem.empty()) std::fprintf(stderr, "%s %s\n", source.name.c_str(), problem.c_str());
  }
  for (const Material& from : materials.materials) {
    oracle::SurfaceMaterial& to = materials_.emplace_back();
    for (size_t c = 0; c < 4; ++c) to.factor[c] = one_from(from.factor[c]);
    if (from.image != Material::kNoImage) to.image = images_[from.image].get();
    to.borders = {border_of(from.wrap[0]), border_of(from.wrap[1])};
    to.transparency = from.alpha_mode == AlphaMode::kOpaque ? oracle::Transparency::kNone
                      : from.alpha_mode == AlphaMode::kMask ? oracle::Transparency::kCutoff
                                                            : oracle::Transparency::kBlend;
    to.cutoff = one_from(from.alpha_cutoff);
  }
}

oracle::Surface SceneLooks::surface(const FixedSurface& from) const {
  oracle::Surface to;
  to.material = &materials_[from.material];
  for (size_t i = 0; i < 3; ++i) {
    for (size_t a = 0; a < 3; ++a) to.position[i][a] = from.position.v[i][a];
    for (size_t a = 0; a < 2; ++a)
      to.corners[i].texture[a] = static_cast<double>(from.corners[i].texture[a]) / 0x1p24;
    for (size_t c = 0; c < 4; ++c) to.corners[i].color[c] = one_from(from.corners[i].color[c]);
  }
  return to;
}

size_t SceneLooks::texels() const {
  size_t texels = 0;
  for (const auto& image : images_)
    if (image) texels += image->texels.size();
  return texels;
}

}  // namespace voxdag
