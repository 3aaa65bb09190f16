// The vertex positions of one primitive as a node draws it: base positions, morphed by the weights,
// skinned at rest. Not thread-safe.
//
//   morph   p = (p0 + w0 * d0) + w1 * d1 ...   targets of weight 0 are not read
//   skin    M = (w0 * M0 + w1 * M1) + ...      entry by entry; p' = M p
//           M = M / (w0 + w1 + ...)            if the weights do not add up to 1
//           M = M0                             if they add up to 0
//
// In the first line, p0 is the base position, and w and d are the weights and displacements of the
// morph targets. In the second line, w and M are the weights and matrices of the vertex's joints.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/base/page_buffer.h"
#include "scene/gltf/mesh_data/accessor_reader.h"
#include "scene/vertices/position_source.h"

namespace voxdag::gltf {

// Returns the matrices of a skin's joints at rest. A matrix is the joint's global transform times
// its inverse bind matrix; the transform of the skinned node has no effect (glTF 2.0, section
// 3.7.3.3). Throws Error{kInvalidInput} for an inverse bind matrix that is not affine, and
// Error{kOutOfMemory} with the skin's name if its joints do not fit the budget of `buffers`.
PageBuffer<Transform> joint_matrices(const Document& document, BufferReader& buffers, int skin);

class VertexSource : public PositionSource {
 public:
  // `weights` are the morph weights of the node or, if it has none, of the mesh. Missing weights
  // are 0, and weights without a target are ignored. `joints` are the matrices of the node's skin,
  // empty without a skin. All arguments must outlive the source. Throws Error{kOutOfMemory} if the
  // targets and joint sets do not fit the budget of `buffers`.
  VertexSource(const Document& document, BufferReader& buffers, const Primitive& primitive,
               std::span<const double> weights, std::span<const Transform> joints);

  uint64_t count() const override { return positions_.count(); }

  // Reads the positions of vertices [first, first + count), three doubles each. A vertex with a
  // joint that does not exist becomes NaN, so that it is refused only if a triangle uses it.
  void read(uint64_t first, size_t count, double* out) override;

 private:
  struct Target {
    AccessorReader displacements;
    double weight;
  };
  struct Influences {
    AccessorReader joints;
    AccessorReader weights;
  };
  // The blended joint matrices of one vertex.
  struct Blend {
    Transform sum = {{{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}}};  // weighted sum of the matrices
    double weights = 0;                                            // sum of the weights
    uint32_t first_joint = 0;
  };

  void add_target(Target& target, uint64_t first, size_t count, double* positions);
  void skin(uint64_t first, size_t count, double* positions);
  void blend(const uint32_t* joints, const double* weights, Blend& blend) const;
  void add(uint32_t joint, double weight, Transform& sum) const;
  void normalize(Blend& blend) const;

  MemoryCharge charge_;  // charge for targets_ and influences_
  AccessorReader positions_;
  std::vector<Target> targets_;
  std::vector<Influences> influences_;
  std::span<const Transform> joints_;
  std::vector<double> displacements_;
  std::vector<Blend> blended_;
  std::vector<double> weights_;
  std::vector<uint32_t> indices_;
};

}  // namespace voxdag::gltf
