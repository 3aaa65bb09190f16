#include "scene/gltf/mesh_data/vertex_source.h"

#include <algorithm>
#include <array>
#include <limits>
#include <unordered_map>

#include "scene/gltf/mesh_data/skin_weights.h"
#include "scene/growing_charge.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

// Computes the global transforms of nodes: the products of all transforms from the root to the
// node. Stores them, because joints share most of their ancestors.
class GlobalTransforms {
 public:
  GlobalTransforms(const Document& document, MemoryBudget& budget, const std::string& what)
      : document_(document), charge_(budget, what) {}

  const Transform& of(int node) {
    std::vector<int> chain;  // the node and its ancestors without a known product
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
  // Memory per node in the map (whose table of buckets is copied when it grows) and in the chain.
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
                                std::to_string(i) +
                                " is not affine, expected 0 0 0 1 as the last row");
    matrices[i] = multiply(matrices[i], inverse_bind);
  }
  return matrices;
}

VertexSource::VertexSource(const Document& document, BufferReader& buffers,
                           const Primitive& primitive, std::span<const double> weights,
                           std::span<const Transform> joints)
    : charge_(buffers.budget(),
              sizeof(Target) * std::min(weights.size(), primitive.targets.size()) +
                  sizeof(Influences) * primitive.joint_sets.size(),
              document.path + ": a primitive with its morph targets and joints"),
      positions_(document, buffers, primitive.position),
      joints_(joints) {
  const size_t weighted = std::min(weights.size(), primitive.targets.size());
  targets_.reserve(weighted);
  influences_.reserve(joints.empty() ? 0 : primitive.joint_sets.size());
  for (size_t t = 0; t < weighted; ++t)
    if (weights[t] != 0 && primitive.targets[t] >= 0)
      targets_.push_back({AccessorReader(document, buffers, primitive.targets[t]), weights[t]});
  if (joints.empty()) return;
  for (const JointSet& set : primitive.joint_sets)
    influences_.push_back({AccessorReader(document, buffers, set.joints),
                           AccessorReader(document, buffers, set.weights)});
}

void VertexSource::read(uint64_t first, size_t count, double* out) {
  positions_.read(first, count, out);
  for (Target& target : targets_) add_target(target, first, count, out);
  if (!influences_.empty()) skin(first, count, out);
}

void VertexSource::add_target(Target& target, uint64_t first, size_t count, double* positions) {
  displacements_.resize(3 * count);
  target.displacements.read(first, count, displacements_.data());
  for (size_t i = 0; i < 3 * count; ++i) positions[i] += target.weight * displacements_[i];
}

void VertexSource::skin(uint64_t first, size_t count, double* positions) {
  blended_.assign(count, Blend{});
  indices_.resize(kInfluencesOfSet * count);
  weights_.resize(kInfluencesOfSet * count);
  for (Influences& set : influences_) {
    set.joints.read(first, count, indices_.data());
    set.weights.read(first, count, weights_.data());
    if (&set == &influences_.front())
      for (size_t i = 0; i < count; ++i) blended_[i].first_joint = indices_[kInfluencesOfSet * i];
    for (size_t i = 0; i < count; ++i)
      blend(&indices_[kInfluencesOfSet * i], &weights_[kInfluencesOfSet * i], blended_[i]);
  }
  for (size_t i = 0; i < count; ++i) {
    if (!is_normalized(blended_[i].weights)) normalize(blended_[i]);
    double skinned[3];
    apply(blended_[i].sum, positions + 3 * i, skinned);
    for (size_t axis = 0; axis < 3; ++axis) positions[3 * i + axis] = skinned[axis];
  }
}

void VertexSource::blend(const uint32_t* joints, const double* weights, Blend& blend) const {
  for (size_t k = 0; k < kInfluencesOfSet; ++k) {
    if (weights[k] == 0) continue;
    blend.weights += weights[k];
    add(joints[k], weights[k], blend.sum);
  }
}

// Adds the joint's matrix, multiplied by the weight. A joint that does not exist makes the sum NaN.
void VertexSource::add(uint32_t joint, double weight, Transform& sum) const {
  const bool exists = joint < joints_.size();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      sum.m[row][column] += exists ? weight * joints_[joint].m[row][column]
                                   : std::numeric_limits<double>::quiet_NaN();
}

// Divides the sum of matrices by the sum of weights. If the weights add up to 0, the matrix of the
// vertex's first joint becomes the sum.
void VertexSource::normalize(Blend& blend) const {
  if (blend.weights == 0) {
    blend.sum = Blend{}.sum;
    return add(blend.first_joint, 1, blend.sum);
  }
  for (auto& row : blend.sum.m)
    for (double& entry : row) entry /= blend.weights;
}

}  // namespace voxdag::gltf
