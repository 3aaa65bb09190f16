#include "scene/gltf/mesh_data/index_restarts.h"

#include <algorithm>
#include <array>
#include <memory>

#include "scene/gltf/document/strip_restarts.h"
#include "scene/gltf/mesh_data/accessor_reader.h"

namespace voxdag::gltf {
namespace {

constexpr size_t kRestartWindow = 4096;

uint32_t restart_of(const Accessor& indices) {
  return UINT32_MAX >> (32 - 8 * component_bytes(indices.component_type));
}

std::shared_ptr<const RestartIndex> find_triangles(Document& document, BufferReader& buffers,
                                                   const Primitive& primitive) {
  AccessorReader reader(document, buffers, primitive.indices);
  const Accessor& indices = document.accessors[static_cast<size_t>(primitive.indices)];
  auto found = std::make_shared<RestartIndex>();
  StripWalk walk(primitive.mode == kTriangleFan, restart_of(indices));
  std::array<uint32_t, kRestartWindow> window;
  for (uint64_t first = 0; first < indices.count; first += kRestartWindow) {
    const auto count =
        static_cast<size_t>(std::min<uint64_t>(kRestartWindow, indices.count - first));
    reader.read(first, count, window.data());
    for (size_t i = 0; i < count; ++i) {
      const StripWalk before = walk;
      uint32_t corners[3];
      if (!walk.add(window[i], corners)) continue;
      if (found->triangles++ % RestartIndex::kTriangles != 0) continue;
      document.charge.add(2 * sizeof(RestartIndex::Entry));  // twice: old and new array
      found->entries.push_back({first + i, before});
    }
  }
  return found;
}

}  // namespace

void index_restarts(Document& document, BufferReader& buffers) {
  if (!document.has_restarts) return;
  for (Mesh& mesh : document.meshes)
    for (Primitive& primitive : mesh.primitives)
      if (mesh.is_drawn && primitive.makes_triangles() && primitive.mode != kTriangleList &&
          primitive.indices >= 0)
        primitive.restarts = find_triangles(document, buffers, primitive);
}

}  // namespace voxdag::gltf
