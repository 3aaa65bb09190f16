#include "scene/ply/surfaces.h"

#include <algorithm>

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/ply/vertex_reader.h"
#include "scene/text/side_files.h"

namespace voxdag::ply {
namespace {

ColorScale scale_of(const Element& element, const std::vector<size_t>& properties) {
  std::vector<Type> types;
  for (const size_t property : properties) types.push_back(element.properties[property].type);
  return ColorScale(std::move(types));
}

ImageSource open_texture(FileSystem& files, const std::string& scene, const std::string& name) {
  ImageSource out;
  out.name = scene + ": texture \"" + printable(name) + "\"";
  try {
    const auto file = open_side_file(files, scene, name);
    out.file = {file->path(), file->identity()};
    out.size = file->size();
  } catch (const Error& error) {
    out.problem = "cannot be opened (" + error.message() + ")";
  }
  return out;
}

}  // namespace

RequestedProperties Surfaces::face_properties(const Layout& layout) {
  RequestedProperties all{.reals = layout.face_texture, .numbers = layout.face_colors};
  if (layout.texture_number != Layout::kNone) all.numbers.push_back(layout.texture_number);
  return all;
}

const Surfaces::Values& Surfaces::values() {
  const std::lock_guard lock(mutex_);
  if (is_ready_) return values_;
  values_ = {};
  open_textures();
  scan_vertices();
  if (ply_.layout().face != Layout::kNone) scan_faces();
  is_ready_ = true;
  return values_;
}

void Surfaces::open_textures() {
  const Layout& layout = ply_.layout();
  SceneMaterials& scene = values_.scene;
  for (const std::string& name : ply_.header().texture_files) {
    Material material;
    material.name = name;
    material.number = static_cast<uint32_t>(scene.names.size());
    material.image = static_cast<uint32_t>(scene.images.size());
    scene.names.push_back(name);
    scene.materials.push_back(std::move(material));
    scene.images.push_back(open_texture(files_, ply_.file().path(), name));
  }
  if (!scene.images.empty() && layout.vertex_texture.empty() &&
      layout.face_texture == Layout::kNone)
    warn("unused-texture", "",
         "names texture files, but has no texture coordinates; the textures are ignored");
  if (layout.ignored_colors.empty()) return;
  std::string names;
  for (const std::string& name : layout.ignored_colors) names += (names.empty() ? "" : ", ") + name;
  warn("ignored-colors", "", "the colors " + names + " are ignored");
}

void Surfaces::scan_vertices() {
  const auto& channels = ply_.layout().vertex_colors;
  ColorScale& scale = values_.vertex_colors = scale_of(ply_.vertex_element(), channels);
  if (scale.needs_numbers()) {
    constexpr uint64_t kBlock = PlyFile::kBlockRows;
    VertexReader reader(ply_, channels, budget_);
    std::vector<double> numbers(kBlock * channels.size());
    for (uint64_t first = 0; first < reader.count(); first += kBlock) {
      cancel_.check();
      const auto count = static_cast<size_t>(std::min(kBlock, reader.count() - first));
      reader.read(first, count, numbers.data());
      for (size_t i = 0; i < count; ++i) scale.add(&numbers[i * channels.size()]);
    }
  }
  scale.set_full_intensities();
}

// Reads the colors of the faces, if necessary, and counts faces whose texture cannot be found.
void Surfaces::scan_faces() {
  const Layout& layout = ply_.layout();
  ColorScale& scale = values_.face_colors = scale_of(ply_.face_element(), layout.face_colors);
  const bool has_texture =
      layout.face_texture != Layout::kNone || layout.texture_number != Layout::kNone;
  if (!scale.needs_numbers() && !has_texture) return;
  const auto rows = ply_.open_faces(face_properties(layout), budget_);
  uint64_t faults = 0, first_fault = 0, offset = 0;
  for (uint64_t row = 0; row < ply_.face_element().count; ++row) {
    if (row % PlyFile::kBlockRows == 0) {
      cancel_.check();
      offset = ply_.face_blocks()[static_cast<size_t>(row / PlyFile::kBlockRows)].offset;
    }
    offset = rows->read(row, offset);
    if (!layout.face_colors.empty()) scale.add(rows->numbers().data());
    const bool has_coordinates =
        !layout.vertex_texture.empty() || rows->reals().size() == 2 * rows->indices().size();
    const bool has_file = layout.texture_number == Layout::kNone ||
                          texture_of(rows->numbers().back()) < values_.scene.images.size();
    if ((has_coordinates && has_file) || faults++ > 0) continue;
    first_fault = row;
  }
  scale.set_full_intensities();
  if (has_texture && faults > 0)
    warn("missing-texture-coordinates", "face " + std::to_string(first_fault),
         "has no texture coordinates, or a texture number without file; it has no texture", faults);
}

void Surfaces::warn(const char* code, const std::string& place, const std::string& message,
                    uint64_t count) {
  const std::string& path = ply_.file().path();
  values_.scene.warnings.add({code, place.empty() ? path : path + ": " + place, message, count});
}

}  // namespace voxdag::ply
