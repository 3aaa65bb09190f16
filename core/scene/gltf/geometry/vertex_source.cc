#include "core/scene/gltf/geometry/vertex_source.h"

#include <limits>

namespace voxdag::gltf {
namespace {

constexpr size_t kInfluencesOfSet = 4;

}  // namespace

VertexSource::VertexSource(const Document& document, BufferReader& buffers,
                           const Primitive& primitive, std::span<const double> weights,
                           std::span<const Transform> joints)
    : charge_(buffers.budget(),
              sizeof(Target) * weights.size() + sizeof(Influences) * primitive.joint_sets.size(),
              document.path + ": a primitive with its morph targets and joints"),
      positions_(document, buffers, primitive.position),
      joints_(joints) {
  targets_.reserve(weights.size());
  influences_.reserve(joints.empty() ? 0 : primitive.joint_sets.size());
  for (size_t t = 0; t < weights.size(); ++t)
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
  blended_.assign(count, Transform{{{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}}});
  indices_.resize(kInfluencesOfSet * count);
  weights_.resize(kInfluencesOfSet * count);
  for (Influences& set : influences_) {
    set.joints.read(first, count, indices_.data());
    set.weights.read(first, count, weights_.data());
    for (size_t i = 0; i < count; ++i)
      blend(&indices_[kInfluencesOfSet * i], &weights_[kInfluencesOfSet * i], blended_[i]);
  }
  for (size_t i = 0; i < count; ++i) {
    double skinned[3];
    apply(blended_[i], positions + 3 * i, skinned);
    for (size_t axis = 0; axis < 3; ++axis) positions[3 * i + axis] = skinned[axis];
  }
}

void VertexSource::blend(const uint32_t* joints, const double* weights, Transform& sum) const {
  for (size_t k = 0; k < kInfluencesOfSet; ++k) {
    if (weights[k] == 0) continue;
    const bool exists = joints[k] < joints_.size();
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 4; ++column)
        sum.m[row][column] += exists ? weights[k] * joints_[joints[k]].m[row][column]
                                     : std::numeric_limits<double>::quiet_NaN();
  }
}

}  // namespace voxdag::gltf
