#include "scene/generate/glb_writer.h"

#include "scene/generate/glb_layout.h"

namespace voxdag {

void GlbWriter::instances(uint32_t, std::span<const Float3> translations,
                          std::span<const Float3> scales) {
  file_.put(translations.data(), translations.size_bytes());
  file_.put(scales.data(), scales.size_bytes());
}

void GlbWriter::write_geometry(const MeshBuilder& mesh) {
  cancel_.check();
  file_.put(mesh.positions.data(), mesh.positions.size() * sizeof(Float3));
  file_.put(mesh.colors.data(), mesh.colors.size() * sizeof(Rgba8));
  const size_t bytes = mesh.indices.size() * sizeof(uint16_t);
  file_.put(mesh.indices.data(), bytes);
  const std::byte padding[4] = {};
  file_.put(padding, padded_index_bytes(mesh.indices.size()) - bytes);
  progress_.advance(mesh.triangles());
}

}  // namespace voxdag
