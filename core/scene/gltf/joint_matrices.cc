#include "core/scene/gltf/joint_matrices.h"

#include <algorithm>
#include <array>

#include "core/scene/gltf/accessor_reader.h"

namespace voxdag::gltf {

Transform global_transform(const Document& document, int node) {
  std::vector<int> chain;
  for (; node >= 0; node = document.nodes[static_cast<size_t>(node)].parent) chain.push_back(node);
  Transform global = document.nodes[static_cast<size_t>(chain.back())].local;
  for (size_t i = chain.size() - 1; i-- > 0;)
    global = multiply(global, document.nodes[static_cast<size_t>(chain[i])].local);
  return global;
}

std::vector<Transform> joint_matrices(const Document& document, BufferReader& buffers, int index) {
  const Skin& skin = document.skins[static_cast<size_t>(index)];
  std::vector<Transform> matrices;
  matrices.reserve(skin.joints.size());
  for (int joint : skin.joints) matrices.push_back(global_transform(document, joint));
  if (skin.inverse_bind < 0) return matrices;
  AccessorReader reader(document, buffers, skin.inverse_bind);
  for (size_t i = 0; i < matrices.size(); ++i) {
    std::array<double, 16> columns;
    reader.read(i, 1, columns.data());
    Transform inverse_bind;
    if (!from_columns(columns.data(), inverse_bind))
      refuse(document.path, document.name_skin(index) + ": " +
                                document.name_accessor(skin.inverse_bind) + ": matrix " +
                                std::to_string(i) + " is not affine");
    matrices[i] = multiply(matrices[i], inverse_bind);
  }
  return matrices;
}

}  // namespace voxdag::gltf
