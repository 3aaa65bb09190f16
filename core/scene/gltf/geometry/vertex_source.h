// The vertex positions of one primitive as a node draws it: base positions, morphed by the weights,
// skinned at rest.
//
//   morph   p = (p0 + w0 * d0) + w1 * d1 ...   targets of weight 0 are not looked at
//   skin    M = (w0 * M0 + w1 * M1) + ...      entry by entry; p' = M p
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/scene/gltf/geometry/accessor_reader.h"
#include "core/scene/gltf/geometry/joint_matrices.h"

namespace voxdag::gltf {

class VertexSource {
 public:
  // `weights` are the node's, else the mesh's; `joints` are empty for what has no skin. All
  // arguments must outlive the source.
  VertexSource(const Document& document, BufferReader& buffers, const Primitive& primitive,
               std::span<const double> weights, std::span<const Transform> joints);

  uint64_t count() const { return positions_.count(); }

  // Positions of vertices [first, first + count), three doubles each. A vertex whose joints do not
  // exist comes out as not a number, so that it is refused only if a triangle uses it.
  void read(uint64_t first, size_t count, double* out);

 private:
  struct Target {
    AccessorReader displacements;
    double weight;
  };
  struct Influences {
    AccessorReader joints;
    AccessorReader weights;
  };

  void add_target(Target& target, uint64_t first, size_t count, double* positions);
  void skin(uint64_t first, size_t count, double* positions);
  void blend(const uint32_t* joints, const double* weights, Transform& sum) const;

  AccessorReader positions_;
  std::vector<Target> targets_;
  std::vector<Influences> influences_;
  std::span<const Transform> joints_;
  std::vector<double> displacements_;
  std::vector<Transform> blended_;
  std::vector<double> weights_;
  std::vector<uint32_t> indices_;
};

}  // namespace voxdag::gltf
