#include "core/scene/gltf/geometry/joint_matrices.h"

#include <array>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/scene/gltf/geometry/accessor_reader.h"
#include "core/scene/gltf/growing_charge.h"
#include "core/scene/gltf/messages.h"

namespace voxdag::gltf {
namespace {

// Products of transforms from the root to a node. Joints share most of their ancestors, so each
// node is multiplied once.
class GlobalTransforms {
 public:
  GlobalTransforms(const Document& document, MemoryBudget& budget, const std::string& what)
      : document_(document), charge_(budget, what) {}

  const Transform& of(int node) {
    std::vector<int> chain;  // from the node up to an ancestor whose product is known
    for (int i = node; i >= 0 && !known_.contains(i); i = parent_of(i)) {
      charge_.add(kBytesPerNode);
      chain.push_back(i);
    }
    for (size_t k = chain.size(); k-- > 0;) {
      const int parent = parent_of(chain[k]);
      const Transform& local = document_.nodes[static_cast<size_t>(chain[k])].local;
      known_[chain[k]] = parent >= 0 ? multiply(known_.at(parent), local) : local;
    }
    return known_.at(node);
  }

 private:
  // In the map, whose table of buckets is copied when it grows, and in the chain.
  static constexpr uint64_t kBytesPerNode = sizeof(Transform) + 72;

  int parent_of(int node) const { return document_.nodes[static_cast<size_t>(node)].parent; }

  const Document& document_;
  GrowingCharge charge_;
  std::unordered_map<int, Transform> known_;
};

}  // namespace

PageBuffer<Transform> joint_matrices(const Document& document, BufferReader& buffers, int index) {
  const Skin& skin = document.skins[static_cast<size_t>(index)];
  const std::string what = document.path + ": " + document.name_skin(index);
  PageBuffer<Transform> matrices(buffers.budget(), skin.joints.size(), what);
  GlobalTransforms globals(document, buffers.budget(), what);
  for (size_t i = 0; i < matrices.size(); ++i) matrices[i] = globals.of(skin.joints[i]);
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
