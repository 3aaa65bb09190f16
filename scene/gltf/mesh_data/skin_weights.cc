#include "scene/gltf/mesh_data/skin_weights.h"

#include <algorithm>
#include <deque>
#include <vector>

#include "scene/gltf/mesh_data/accessor_reader.h"
#include "scene/gltf/mesh_data/node_walk.h"

namespace voxdag::gltf {
namespace {

constexpr uint64_t kWeightWindow = 1024;

// Numbers of vertices whose weights are missing or are not normalized.
struct Faults {
  uint64_t without_weights = 0;
  uint64_t not_normalized = 0;
};

Faults find_faults(const Document& document, BufferReader& buffers, const Primitive& primitive) {
  std::deque<AccessorReader> sets;
  for (const JointSet& set : primitive.joint_sets)
    sets.emplace_back(document, buffers, set.weights);
  Faults faults;
  std::vector<double> sums, weights;
  const uint64_t vertices = document.accessors[static_cast<size_t>(primitive.position)].count;
  for (uint64_t first = 0; first < vertices; first += kWeightWindow) {
    const auto count = static_cast<size_t>(std::min(kWeightWindow, vertices - first));
    sums.assign(count, 0);
    weights.resize(kInfluencesOfSet * count);
    for (AccessorReader& set : sets) {
      set.read(first, count, weights.data());
      for (size_t i = 0; i < weights.size(); ++i) sums[i / kInfluencesOfSet] += weights[i];
    }
    for (const double sum : sums) {
      faults.without_weights += sum == 0;
      faults.not_normalized += sum != 0 && !is_normalized(sum);
    }
  }
  return faults;
}

}  // namespace

void warn_of_weights(const Document& document, BufferReader& buffers, WarningList& warnings) {
  std::vector<bool> is_read(document.meshes.size());
  NodeWalk walk(document, buffers.budget());
  while (walk.next()) {
    const Node& node = document.nodes[static_cast<size_t>(walk.node())];
    const auto mesh = static_cast<size_t>(node.mesh);
    if (node.skin < 0 || is_read[mesh]) continue;
    is_read[mesh] = true;
    const std::vector<Primitive>& primitives = document.meshes[mesh].primitives;
    for (size_t p = 0; p < primitives.size(); ++p) {
      if (!primitives[p].makes_triangles() || primitives[p].joint_sets.empty()) continue;
      const Faults faults = find_faults(document, buffers, primitives[p]);
      const std::string place =
          document.path + ": " + document.name_mesh(node.mesh) + ": primitive " + std::to_string(p);
      if (faults.without_weights > 0)
        warnings.add({"no-weights", place,
                      "a skinned vertex has no weights; its first joint moves it",
                      faults.without_weights});
      if (faults.not_normalized > 0)
        warnings.add({"unnormalized-weights", place,
                      "the weights of a vertex do not add up to 1; they are divided by their sum",
                      faults.not_normalized});
    }
  }
}

}  // namespace voxdag::gltf
